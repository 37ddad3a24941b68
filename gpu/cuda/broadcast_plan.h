// How an upload goes to several devices: piece by piece, each broadcast while the next is copied.
#pragma once

#include <cstddef>
#include <vector>

#include "gpu/cuda/upload_plan.h"

namespace voxeld::gpu::cuda {

// A run of the devices' memory, and what of it comes from the host.
struct BroadcastStep {
  size_t begin = 0, size = 0;
  std::vector<UploadPlan::Copy> copies;
};

// Runs of `most` bytes (the last may be shorter) that together are the plan's memory. It follows from
// the plan alone, so all ranks that were given one delta have the same.
std::vector<BroadcastStep> BroadcastSteps(const UploadPlan& plan, size_t most);

}  // namespace voxeld::gpu::cuda
