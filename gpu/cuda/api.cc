#include "gpu/cuda/api.h"

#include "absl/strings/str_cat.h"

namespace voxeld::gpu::cuda {
namespace {

std::string Name(cudaError_t error) {
  return absl::StrCat(cudaGetErrorName(error), " (", cudaGetErrorString(error), ")");
}

}  // namespace

absl::StatusOr<std::unique_ptr<Api>> Api::Open(int device) {
  int count = 0;
  if (const cudaError_t error = cudaGetDeviceCount(&count); error != cudaSuccess) {
    return absl::FailedPreconditionError(absl::StrCat("no CUDA device can be used: ", Name(error)));
  }
  if (device < 0 || device >= count) {
    return absl::FailedPreconditionError(
        absl::StrCat("CUDA device ", device, " was asked for; there are ", count));
  }
  cudaDeviceProp properties;
  cudaError_t error = cudaGetDeviceProperties(&properties, device);
  if (error == cudaSuccess) error = cudaSetDevice(device);
  if (error == cudaSuccess) error = cudaSetDeviceFlags(cudaDeviceScheduleBlockingSync);
  if (error == cudaSuccess) error = cudaFree(nullptr);  // creates the context
  if (error != cudaSuccess) {
    return absl::FailedPreconditionError(
        absl::StrCat("CUDA device ", device, " cannot be used: ", Name(error)));
  }
  return std::unique_ptr<Api>(new Api(device, properties));
}

absl::Status Api::Enter() const {
  const cudaError_t error = cudaSetDevice(device_);
  return error == cudaSuccess ? absl::OkStatus() : Failed("cudaSetDevice", error);
}

absl::Status Api::Failed(const char* what, cudaError_t error) {
  cudaGetLastError();  // errors that are not sticky are reported once
  return ToStatus(what, error);
}

absl::Status Api::ToStatus(const char* what, cudaError_t error) {
  if (error == cudaErrorMemoryAllocation) {
    return absl::ResourceExhaustedError(
        absl::StrCat(what, ": the device is out of memory; show less, or on a larger device"));
  }
  return absl::DataLossError(absl::StrCat(what, ": ", Name(error)));
}

}  // namespace voxeld::gpu::cuda
