// An engine whose calls block until they are answered, for tests.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "tests/conformance/scene_model.h"

namespace voxeld::gpu::conformance {

// One kind of engine under test.
struct EngineCase {
  std::string name;
  std::function<absl::StatusOr<std::unique_ptr<Engine>>(EngineOptions)> create;
};

inline void PrintTo(const EngineCase& engine_case, std::ostream* out) { *out << engine_case.name; }

class EngineDriver {
 public:
  EngineDriver(const EngineCase& engine_case, EngineOptions options);

  Engine& engine() { return *engine_; }
  absl::Status SetTarget(const Target& target);
  absl::Status Apply(const DeltaBuffer& delta);
  absl::Status ApplyBytes(std::span<const std::byte> delta, std::vector<BulkBlock> referred = {});

  // Draws a frame into a buffer of its own, which holds the previous frame.
  absl::StatusOr<FrameResult> Frame();
  absl::StatusOr<FrameResult> Frame(const FrameRequest& request, FrameBuffer buffer);
  std::vector<uint32_t> Voxels();  // of the whole grid

  const std::vector<std::byte>& pictures() const { return bytes_; }
  const std::vector<uint64_t>& changed_in() const { return changed_in_; }
  uint64_t frame() const { return frame_; }

 private:
  std::unique_ptr<Engine> engine_;
  Target target_;
  std::vector<std::byte> bytes_;
  std::vector<uint64_t> changed_in_;
  uint64_t frame_ = 0, held_ = 0;
};

}  // namespace voxeld::gpu::conformance
