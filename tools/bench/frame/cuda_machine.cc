#include "tools/bench/frame/cuda_machine.h"

#include <cuda_runtime_api.h>

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cuda/cuda_engine.h"
#include "gpu/cuda/pin.h"

namespace voxeld::bench::frame {
namespace {

absl::Status ToStatus(const char* what, cudaError_t error) {
  if (error == cudaSuccess) return absl::OkStatus();
  return absl::InternalError(std::string(what) + ": " + cudaGetErrorString(error));
}

class DeviceToHost final : public Ceiling {
 public:
  static absl::StatusOr<std::unique_ptr<Ceiling>> Create(size_t bytes) {
    std::unique_ptr<DeviceToHost> copy(new DeviceToHost(bytes));
    absl::Status status = ToStatus("cudaMalloc", cudaMalloc(&copy->device_, bytes));
    if (status.ok()) status = ToStatus("cudaMallocHost", cudaMallocHost(&copy->host_, bytes));
    if (!status.ok()) return status;
    return copy;
  }
  ~DeviceToHost() override {
    cudaFree(device_);
    cudaFreeHost(host_);
  }
  std::string name() const override {
    return absl::StrCat("copy of ", bytes_, " bytes to pinned memory");
  }
  absl::Status Run() override {
    return ToStatus("cudaMemcpy", cudaMemcpy(host_, device_, bytes_, cudaMemcpyDeviceToHost));
  }

 private:
  explicit DeviceToHost(size_t bytes) : bytes_(bytes) {}
  const size_t bytes_;
  void* device_ = nullptr;
  void* host_ = nullptr;
};

class DeviceCopy final : public Ceiling {
 public:
  static absl::StatusOr<std::unique_ptr<Ceiling>> Create(size_t bytes) {
    std::unique_ptr<DeviceCopy> copy(new DeviceCopy(bytes));
    for (void** place : {&copy->from_, &copy->to_}) {
      const absl::Status status = ToStatus("cudaMalloc", cudaMalloc(place, bytes));
      if (!status.ok()) return status;
    }
    return copy;
  }
  ~DeviceCopy() override {
    cudaFree(from_);
    cudaFree(to_);
  }
  std::string name() const override {
    return absl::StrCat("copy of ", bytes_, " bytes within the device");
  }
  absl::Status Run() override {
    const absl::Status status =
        ToStatus("cudaMemcpy", cudaMemcpyAsync(to_, from_, bytes_, cudaMemcpyDeviceToDevice));
    if (!status.ok()) return status;
    return ToStatus("cudaDeviceSynchronize", cudaDeviceSynchronize());
  }

 private:
  explicit DeviceCopy(size_t bytes) : bytes_(bytes) {}
  const size_t bytes_;
  void* from_ = nullptr;
  void* to_ = nullptr;
};

}  // namespace

absl::StatusOr<std::unique_ptr<gpu::Engine>> MakeCudaEngine(const gpu::EngineOptions& options,
                                                            bool keep_tiles) {
  return gpu::CreateCudaEngine(
      options, "a benchmark", {},
      {.pack_as_drawn = !keep_tiles, .compile_formulas = gpu::cuda::CompileFormulas::kAtOnce});
}

absl::StatusOr<std::unique_ptr<Ceiling>> DeviceCopyCeiling(size_t bytes) {
  return DeviceCopy::Create(bytes);
}

void PinFrame(std::span<std::byte> bytes) { gpu::cuda::PinMemory(bytes); }
void UnpinFrame(std::span<std::byte> bytes) { gpu::cuda::UnpinMemory(bytes); }

absl::StatusOr<std::unique_ptr<Ceiling>> DeviceToHostCeiling(size_t bytes) {
  return DeviceToHost::Create(bytes);
}

}  // namespace voxeld::bench::frame
