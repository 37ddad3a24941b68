// Draws scenes that differ a little, one after another, for one display.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/scene/engine_delta.h"
#include "daemon/scene/snapshot.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

// Returns: a target whose slice images are the voxels of `target`'s grid, three bytes each (red,
// green, blue), x fastest, then y, then z. They include voxels that none of the display's pixels
// shows.
gpu::Target VoxelsOf(const gpu::Target& target);

// Single-threaded.
class Stage {
 public:
  // `cancelled` may be empty.
  static absl::StatusOr<std::unique_ptr<Stage>> Make(const gpu::Target& target,
                                                     std::function<bool()> cancelled);

  // Draws `scene`. Requires: its `uses` is empty. Errors: Cancelled, or the engine's error.
  absl::Status Draw(SnapshotPtr scene);

  // Returns: the slice images of the last drawing, as they are sent to the display.
  const std::vector<std::byte>& pictures() const { return pictures_; }

 private:
  Stage(std::unique_ptr<gpu::Engine> engine, const gpu::Target& target,
        std::function<bool()> cancelled);

  const std::function<bool()> cancelled_;
  const std::unique_ptr<gpu::Engine> engine_;
  EngineScene held_;
  std::vector<std::byte> pictures_;
  std::vector<uint64_t> changed_in_;
  uint64_t frame_ = 0;
};

}  // namespace voxeld::daemon
