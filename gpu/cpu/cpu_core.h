// The work of the CPU engine, without its threads: the operations behind each call of gpu/engine.h.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/assemble/volume.h"
#include "gpu/cpu/executor.h"
#include "gpu/engine.h"
#include "gpu/slice/light_plan.h"
#include "gpu/slice/pictures.h"

namespace voxeld::gpu {

// Thread-bound. An error leaves the core as it was.
class CpuCore {
 public:
  // `index_bytes`: see EngineOptions.
  CpuCore(std::unique_ptr<Executor> executor, SlicePart part, uint64_t index_bytes = 0);

  absl::Status SetTarget(Target target);
  absl::Status Apply(const StagingBlock& block, size_t size);
  absl::StatusOr<FrameResult> SubmitFrame(const FrameRequest& request, FrameBuffer buffer);
  absl::Status ReadVoxels(VoxelBox box, std::span<uint32_t> out);

 private:
  void UpdateVolume(TileObserver* observer);

  const std::unique_ptr<Executor> executor_;
  const SlicePart part_;
  std::optional<display::FrameLayout> layout_;  // the target's
  Volume volume_;
  Pictures pictures_;
  LightPlanner lights_;
  Volume::Changes unsliced_;  // changes to the volume that no frame has shown yet
  std::vector<uint32_t>
      unobserved_;  // those of its tiles whose drawing the slice images did not observe
  uint64_t last_frame_ = 0;
};

}  // namespace voxeld::gpu
