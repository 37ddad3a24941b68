// The work of the CUDA engine, without its threads: the operations behind each call of
// gpu/engine.h.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/cuda_pictures.h"
#include "gpu/cuda/cuda_volume.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/stopwatch.h"
#include "gpu/cuda/tuning.h"
#include "gpu/cuda/uploader.h"
#include "gpu/engine.h"
#include "gpu/slice/light_plan.h"

namespace voxeld::gpu::cuda {

// Thread-bound, but may be created in another thread. An error leaves it as it was, unless it is
// DataLoss.
class CudaCore {
 public:
  CudaCore(std::unique_ptr<Device> device, SlicePart part, const Tuning& tuning = {});

  absl::Status SetTarget(const Target& target);
  absl::Status Apply(const StagingBlock& block, size_t size);
  absl::StatusOr<FrameResult> SubmitFrame(const FrameRequest& request, FrameBuffer buffer);
  absl::Status ReadVoxels(VoxelBox box, std::span<uint32_t> out);
  RankLink* link() { return &uploader_; }

 private:
  const std::unique_ptr<Device> device_;
  const SlicePart part_;
  const Tuning tuning_;
  std::optional<display::FrameLayout> layout_;  // the target's
  Uploader uploader_;
  Stopwatch stopwatch_;
  CudaVolume volume_;
  std::unique_ptr<CudaPictures> pictures_;
  LightPlanner lights_;
  uint64_t last_frame_ = 0;
};

}  // namespace voxeld::gpu::cuda
