#include "gpu/cuda/device.h"

namespace voxeld::gpu::cuda {

absl::StatusOr<std::unique_ptr<Device>> Device::Open(int device) {
  absl::StatusOr<std::unique_ptr<Api>> api = Api::Open(device);
  if (!api.ok()) return api.status();
  std::unique_ptr<Device> made(new Device(*std::move(api)));
  for (cudaStream_t* stream : {&made->stream_, &made->copies_}) {
    absl::Status status = made->api_->Call("cudaStreamCreateWithFlags", [&] {
      return cudaStreamCreateWithFlags(stream, cudaStreamNonBlocking);
    });
    if (!status.ok()) return status;
  }
  return made;
}

Device::~Device() {
  for (const Time& time : times_) {
    cudaEventDestroy(time.begin);
    cudaEventDestroy(time.end);
  }
  for (cudaStream_t stream : {stream_, copies_}) {
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

absl::Status Device::BeginTime(const char* what) {
  Time time{what, nullptr, nullptr};
  for (cudaEvent_t* event : {&time.begin, &time.end}) {
    absl::Status status = api_->Call("cudaEventCreate", [&] { return cudaEventCreate(event); });
    if (!status.ok()) return status;
  }
  times_.push_back(time);
  return api_->Call("cudaEventRecord", [&] { return cudaEventRecord(time.begin, stream_); });
}

absl::Status Device::EndTime() {
  return api_->Call("cudaEventRecord", [&] { return cudaEventRecord(times_.back().end, stream_); });
}

absl::StatusOr<std::map<std::string, double>> Device::TakeTimes() {
  if (absl::Status status = Wait(); !status.ok()) return status;
  std::map<std::string, double> taken;
  float ms = 0;
  for (const Time& time : times_) {
    if (cudaEventElapsedTime(&ms, time.begin, time.end) == cudaSuccess) {
      taken[time.what] += static_cast<double>(ms);
    }
  }
  if (!times_.empty() &&
      cudaEventElapsedTime(&ms, times_.front().begin, times_.back().end) == cudaSuccess) {
    taken["all"] = static_cast<double>(ms);
  }
  for (const Time& time : times_) {
    cudaEventDestroy(time.begin);
    cudaEventDestroy(time.end);
  }
  times_.clear();
  return taken;
}

absl::StatusOr<Block> Device::Zeros(size_t bytes) {
  absl::StatusOr<Block> block = pool_.Acquire(bytes);
  if (!block.ok()) return block;
  if (absl::Status status = Zero(block->as<std::byte>(), bytes); !status.ok()) return status;
  return block;
}

}  // namespace voxeld::gpu::cuda
