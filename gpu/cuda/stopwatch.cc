#include "gpu/cuda/stopwatch.h"

#include <cmath>

namespace voxeld::gpu::cuda {

Stopwatch::~Stopwatch() {
  for (cudaEvent_t mark : marks_) {
    if (mark != nullptr) cudaEventDestroy(mark);
  }
}

absl::Status Stopwatch::Set(Mark mark) {
  cudaEvent_t& event = marks_[static_cast<size_t>(mark)];
  if (event == nullptr) {
    absl::Status status = device_.Run("cudaEventCreate", [&] { return cudaEventCreate(&event); });
    if (!status.ok()) return status;
  }
  return device_.Run("cudaEventRecord", [&] { return cudaEventRecord(event, device_.stream()); });
}

absl::StatusOr<int64_t> Stopwatch::Between(Mark from, Mark to) {
  float ms = 0;
  const cudaEvent_t begin = marks_[static_cast<size_t>(from)],
                    end = marks_[static_cast<size_t>(to)];
  absl::Status status =
      device_.Run("cudaEventSynchronize", [&] { return cudaEventSynchronize(end); });
  if (!status.ok()) return status;
  status =
      device_.Run("cudaEventElapsedTime", [&] { return cudaEventElapsedTime(&ms, begin, end); });
  if (!status.ok()) return status;
  return std::llround(static_cast<double>(ms) * 1e6);
}

}  // namespace voxeld::gpu::cuda
