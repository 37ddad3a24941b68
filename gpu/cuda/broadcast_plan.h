// Plans how an upload reaches several devices: piece by piece, where each piece is broadcast while
// the next is copied.
#pragma once

#include <cstddef>
#include <vector>

#include "gpu/cuda/upload_plan.h"

namespace voxeld::gpu::cuda {

// A run of the devices' memory, and the copies into it from the host.
struct BroadcastStep {
  size_t begin = 0, size = 0;
  std::vector<UploadPlan::Copy> copies;
};

// Returns runs of `most` bytes (the last may be shorter) that together are the plan's memory. The
// result depends on the plan alone, so all ranks that received the same delta have the same steps.
std::vector<BroadcastStep> BroadcastSteps(const UploadPlan& plan, size_t most);

}  // namespace voxeld::gpu::cuda
