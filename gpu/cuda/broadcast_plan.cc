#include "gpu/cuda/broadcast_plan.h"

#include <algorithm>

namespace voxeld::gpu::cuda {

std::vector<BroadcastStep> BroadcastSteps(const UploadPlan& plan, size_t most) {
  std::vector<BroadcastStep> steps;
  for (size_t begin = 0; begin < plan.size(); begin += most) {
    steps.push_back({begin, std::min(most, plan.size() - begin), {}});
  }
  for (const UploadPlan::Copy& copy : plan.copies()) {
    for (size_t done = 0; done < copy.size;) {
      BroadcastStep& step = steps[(copy.to + done) / most];
      const size_t size = std::min(copy.size - done, step.begin + step.size - (copy.to + done));
      step.copies.push_back({copy.from + done, size, copy.to + done});
      done += size;
    }
  }
  return steps;
}

}  // namespace voxeld::gpu::cuda
