#include "gpu/cuda/device.h"

namespace voxeld::gpu::cuda {

absl::StatusOr<std::unique_ptr<Device>> Device::Open(int device) {
  absl::StatusOr<std::unique_ptr<Api>> api = Api::Open(device);
  if (!api.ok()) return api.status();
  std::unique_ptr<Device> made(new Device(*std::move(api)));
  for (cudaStream_t* stream : {&made->stream_, &made->copies_, &made->beside_}) {
    absl::Status status = made->api_->Call("cudaStreamCreateWithFlags", [&] {
      return cudaStreamCreateWithFlags(stream, cudaStreamNonBlocking);
    });
    if (!status.ok()) return status;
  }
  return made;
}

Device::~Device() {
  for (cudaStream_t stream : {stream_, copies_, beside_}) {
    if (stream == nullptr) continue;
    cudaStreamSynchronize(stream);
    cudaStreamDestroy(stream);
  }
}

absl::Status Device::ToDevice(void* to, const void* from, size_t bytes) {
  if (bytes == 0) return absl::OkStatus();
  return api_->Call("cudaMemcpyAsync", [&] {
    return cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream_);
  });
}

absl::Status Device::ToHost(void* to, const void* from, size_t bytes) {
  if (bytes == 0) return absl::OkStatus();
  return api_->Call("cudaMemcpyAsync", [&] {
    return cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream_);
  });
}

absl::Status Device::Zero(void* at, size_t bytes) {
  if (bytes == 0) return absl::OkStatus();
  return api_->Call("cudaMemsetAsync", [&] { return cudaMemsetAsync(at, 0, bytes, stream_); });
}

absl::Status Device::Wait() {
  return api_->Call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream_); });
}

absl::StatusOr<Block> Device::Zeros(size_t bytes) {
  absl::StatusOr<Block> block = pool_.Acquire(bytes);
  if (!block.ok()) return block;
  if (absl::Status status = Zero(block->as<std::byte>(), bytes); !status.ok()) return status;
  return block;
}

}  // namespace voxeld::gpu::cuda
