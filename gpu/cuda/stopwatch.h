// Measures when the device has finished the work in its stream.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"

namespace voxeld::gpu::cuda {

// Thread-bound.
class Stopwatch {
 public:
  enum class Mark : uint8_t { kBegun, kAssembled, kPacked };

  explicit Stopwatch(Device& device) : device_(device) {}
  ~Stopwatch();
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

  // Sets the mark after the work queued in the device's stream.
  absl::Status Set(Mark mark);
  // Returns the nanoseconds from one mark to a later one, for which it waits.
  absl::StatusOr<int64_t> Between(Mark from, Mark to);

 private:
  Device& device_;
  cudaEvent_t marks_[3] = {};
};

}  // namespace voxeld::gpu::cuda
