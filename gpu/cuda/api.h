// The one layer through which CUDA is called: counts the calls, turns their errors into Status, and
// can make any of them fail. (Not through it go the end of things, where an error changes nothing,
// and the pinning of memory, where it costs speed.)
//
//   api.Call("cudaMemcpyAsync", [&] { return cudaMemcpyAsync(…); });
//
// Codes: ResourceExhausted (out of memory; the device goes on), DataLoss (everything else: an
// illegal address and its kin are sticky, the process that saw one can never use the device again,
// and what the device holds cannot be trusted), FailedPrecondition (no driver, no device; from Open
// alone).
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

// Which call fails, and how.
struct FaultPlan {
  uint64_t call = 0;  // the n-th from the plan's setting on, 1 the next; 0: none
  cudaError_t error = cudaSuccess;
  bool sticky = false;  // so does every later one

  // What the n-th call ends in; cudaSuccess: as it would without a plan.
  cudaError_t At(uint64_t n) const {
    const bool fails = call != 0 && (n == call || (sticky && n > call));
    return fails ? error : cudaSuccess;
  }
};

// Thread-safe, but for SetFaults.
class Api {
 public:
  // The device of that number. FailedPrecondition says what is missing.
  static absl::StatusOr<std::unique_ptr<Api>> Open(int device);

  const cudaDeviceProp& device() const { return properties_; }
  // Makes the device current in the calling thread: once in each that calls.
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
