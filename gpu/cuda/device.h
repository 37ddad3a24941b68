// A device with its memory and its streams of work.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstring>
#include <memory>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/api.h"
#include "gpu/cuda/pool.h"

namespace voxeld::gpu::cuda {

// Thread-bound after its creation.
class Device {
 public:
  static absl::StatusOr<std::unique_ptr<Device>> Open(int device);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  Api& api() { return *api_; }
  Pool& pool() { return pool_; }
  cudaStream_t stream() const { return stream_; }  // the main work
  cudaStream_t copies() const { return copies_; }  // copies of results to the host
  cudaStream_t beside() const { return beside_; }  // work that need not follow the main work

  // Queues a kernel.
  template <typename Function>
  absl::Status Run(const char* what, Function&& function) {
    return api_->Call(what, std::forward<Function>(function));
  }
  absl::Status ToDevice(void* to, const void* from, size_t bytes);
  absl::Status ToHost(void* to, const void* from, size_t bytes);
  absl::Status Zero(void* at, size_t bytes);
  absl::Status Wait();  // for the main work

  // Returns a block with `count` values, copied from `from`.
  template <typename T>
  absl::StatusOr<Block> Upload(const T* from, size_t count) {
    absl::StatusOr<Block> block = pool_.Acquire(count * sizeof(T));
    if (!block.ok()) return block;
    if (absl::Status status = ToDevice(block->as<T>(), from, count * sizeof(T)); !status.ok()) {
      return status;
    }
    return block;
  }
  // Returns a block of zeros.
  absl::StatusOr<Block> Zeros(size_t bytes);
  // Returns the value at a device address, after all work before.
  template <typename T>
  absl::StatusOr<T> Read(const T* from) {
    T value;
    absl::Status status = ToHost(&value, from, sizeof(T));
    if (status.ok()) status = Wait();
    if (!status.ok()) return status;
    return value;
  }

 private:
  explicit Device(std::unique_ptr<Api> api) : api_(std::move(api)), pool_(*api_) {}

  const std::unique_ptr<Api> api_;
  Pool pool_;
  cudaStream_t stream_ = nullptr, copies_ = nullptr, beside_ = nullptr;
};

}  // namespace voxeld::gpu::cuda
