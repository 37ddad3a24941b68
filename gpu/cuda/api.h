// The only layer through which CUDA is called: it counts the calls, turns their errors into Status,
// and can make any of them fail. (Exceptions are calls in destructors, where an error changes
// nothing, and the pinning of memory, where an error only costs speed.)
//
//   api.Call("cudaMemcpyAsync", [&] { return cudaMemcpyAsync(…); });
//
// Codes: ResourceExhausted (out of memory; the device continues to work), DataLoss (every other
// error: an illegal address and similar errors are sticky, so the process can never use the device
// again, and the contents of the device cannot be trusted), FailedPrecondition (no driver, no
// device; only from Open).
#pragma once

#include <cuda_runtime_api.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::gpu::cuda {

// Which call fails, and with which error.
struct FaultPlan {
  uint64_t call = 0;  // the n-th call after the plan was set, 1 is the next; 0: none
  cudaError_t error = cudaSuccess;
  bool sticky = false;  // every later call fails too

  // Returns the error of the n-th call; cudaSuccess: the call's own result.
  cudaError_t At(uint64_t n) const {
    const bool fails = call != 0 && (n == call || (sticky && n > call));
    return fails ? error : cudaSuccess;
  }
};

// Thread-safe, except for SetFaults.
class Api {
 public:
  // Opens the device of that number. Errors: FailedPrecondition says what is missing.
  static absl::StatusOr<std::unique_ptr<Api>> Open(int device);

  const cudaDeviceProp& device() const { return properties_; }
  // Makes the device current in the calling thread. Must be called once in each thread that uses
  // the device.
  absl::Status Enter() const;

  template <typename Function>
  absl::Status Call(const char* what, Function&& function) {
    if (const cudaError_t injected = plan_.At(++calls_); injected != cudaSuccess) {
      return ToStatus(what, injected);
    }
    const cudaError_t error = function();
    return error == cudaSuccess ? absl::OkStatus() : Failed(what, error);
  }

  void SetFaults(const FaultPlan& plan) {
    plan_ = plan;
    calls_ = 0;
  }
  uint64_t calls() const { return calls_; }

 private:
  Api(int device, const cudaDeviceProp& properties) : device_(device), properties_(properties) {}
  static absl::Status Failed(const char* what, cudaError_t error);
  static absl::Status ToStatus(const char* what, cudaError_t error);

  const int device_;
  const cudaDeviceProp properties_;
  std::atomic<uint64_t> calls_{0};
  FaultPlan plan_;
};

}  // namespace voxeld::gpu::cuda
