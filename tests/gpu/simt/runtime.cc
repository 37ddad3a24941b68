#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <new>
#include <utility>

#include "cuda_runtime_api.h"
#include "tests/gpu/simt/limits.h"

// Counts moments: whatever was recorded in a stream before it was waited for has happened.
static std::atomic<uint64_t> moments{0};
struct CUstream_st {
  std::atomic<uint64_t> waited{0};
};
struct CUevent_st {
  std::chrono::steady_clock::time_point recorded;
  cudaStream_t stream = nullptr;
  uint64_t at = 0;
  bool waited = false;
};

namespace voxeld::simt {
namespace {

constexpr size_t kSharedUnasked = size_t{48} << 10, kSharedMost = size_t{227} << 10;
constexpr uint32_t kThreadsMost = 1024;
constexpr std::align_val_t kAlignment{256};

thread_local cudaError_t last_error = cudaSuccess;

cudaError_t Told(cudaError_t error) {
  if (error != cudaSuccess) last_error = error;
  return error;
}

// The shared memory that kernels were given beyond the default limit.
struct SharedLimits {
  std::mutex mutex;
  std::map<const void*, size_t> bytes;
};
SharedLimits shared_limits;

size_t SharedLimitOf(const void* kernel) {
  const std::lock_guard lock(shared_limits.mutex);
  const auto it = shared_limits.bytes.find(kernel);
  return it == shared_limits.bytes.end() ? kSharedUnasked : it->second;
}

}  // namespace

bool IsAllowed(const Grid& grid) {
  const auto count = [](dim3 size) { return static_cast<uint64_t>(size.x) * size.y * size.z; };
  const bool allowed = count(grid.blocks) > 0 && count(grid.threads) > 0 &&
                       count(grid.threads) <= kThreadsMost && grid.blocks.x <= 0x7FFFFFFF &&
                       grid.blocks.y <= 0xFFFF && grid.blocks.z <= 0xFFFF &&
                       grid.shared <= SharedLimitOf(grid.kernel);
  return Told(allowed ? cudaSuccess : cudaErrorInvalidConfiguration) == cudaSuccess;
}

uint64_t Seed() {
  const char* const seed = std::getenv("VOXELD_SEED");
  return seed != nullptr ? std::strtoull(seed, nullptr, 10) : 1;
}

}  // namespace voxeld::simt

using voxeld::simt::Told;

const char* cudaGetErrorName(cudaError_t error) {
  switch (error) {
    case cudaSuccess:
      return "cudaSuccess";
    case cudaErrorInvalidValue:
      return "cudaErrorInvalidValue";
    case cudaErrorMemoryAllocation:
      return "cudaErrorMemoryAllocation";
    case cudaErrorInvalidConfiguration:
      return "cudaErrorInvalidConfiguration";
    case cudaErrorInvalidDevice:
      return "cudaErrorInvalidDevice";
    case cudaErrorNotReady:
      return "cudaErrorNotReady";
    case cudaErrorIllegalAddress:
      return "cudaErrorIllegalAddress";
    case cudaErrorNotSupported:
      return "cudaErrorNotSupported";
  }
  return "cudaErrorUnknown";
}
const char* cudaGetErrorString(cudaError_t error) { return cudaGetErrorName(error); }
cudaError_t cudaGetLastError() { return std::exchange(voxeld::simt::last_error, cudaSuccess); }

cudaError_t cudaGetDeviceCount(int* count) {
  *count = 1;
  return cudaSuccess;
}
cudaError_t cudaGetDeviceProperties(cudaDeviceProp* properties, int device) {
  if (device != 0) return Told(cudaErrorInvalidDevice);
  *properties = {};
  std::snprintf(properties->name, sizeof(properties->name), "a GPU that a CPU plays");
  properties->totalGlobalMem = size_t{16} << 30;
  properties->sharedMemPerBlock = voxeld::simt::kSharedUnasked;
  properties->sharedMemPerBlockOptin = voxeld::simt::kSharedMost;
  properties->multiProcessorCount = 3;
  properties->major = 9;
  return cudaSuccess;
}
cudaError_t cudaSetDevice(int device) {
  return device == 0 ? cudaSuccess : Told(cudaErrorInvalidDevice);
}
cudaError_t cudaSetDeviceFlags(unsigned) { return cudaSuccess; }

cudaError_t cudaMalloc(void** memory, size_t bytes) {
  *memory = ::operator new(bytes, voxeld::simt::kAlignment, std::nothrow);
  if (*memory == nullptr) return Told(cudaErrorMemoryAllocation);
  std::memset(*memory, 0xA5, bytes);
  return cudaSuccess;
}
cudaError_t cudaFree(void* memory) {
  ::operator delete(memory, voxeld::simt::kAlignment);
  return cudaSuccess;
}
cudaError_t cudaMallocHost(void** memory, size_t bytes) { return cudaMalloc(memory, bytes); }
cudaError_t cudaHostAlloc(void** memory, size_t bytes, unsigned) {
  return cudaMalloc(memory, bytes);
}
cudaError_t cudaFreeHost(void* memory) { return cudaFree(memory); }
cudaError_t cudaHostRegister(void*, size_t, unsigned) { return cudaSuccess; }
cudaError_t cudaHostUnregister(void*) { return cudaSuccess; }
cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind,
                            cudaStream_t) {
  std::memmove(to, from, bytes);
  return cudaSuccess;
}
cudaError_t cudaMemsetAsync(void* memory, int value, size_t bytes, cudaStream_t) {
  std::memset(memory, value, bytes);
  return cudaSuccess;
}
cudaError_t cudaMemcpy(void* to, const void* from, size_t bytes, cudaMemcpyKind kind) {
  return cudaMemcpyAsync(to, from, bytes, kind, nullptr);
}
cudaError_t cudaMemset(void* memory, int value, size_t bytes) {
  return cudaMemsetAsync(memory, value, bytes, nullptr);
}

cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned) {
  *stream = new CUstream_st;
  return cudaSuccess;
}
cudaError_t cudaStreamDestroy(cudaStream_t stream) {
  delete stream;
  return cudaSuccess;
}
cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
  if (stream != nullptr) stream->waited = ++moments;
  return cudaSuccess;
}
cudaError_t cudaStreamWaitEvent(cudaStream_t, cudaEvent_t, unsigned) { return cudaSuccess; }
cudaError_t cudaEventCreate(cudaEvent_t* event) {
  *event = new CUevent_st;
  return cudaSuccess;
}
cudaError_t cudaEventCreateWithFlags(cudaEvent_t* event, unsigned) {
  return cudaEventCreate(event);
}
cudaError_t cudaEventDestroy(cudaEvent_t event) {
  delete event;
  return cudaSuccess;
}
cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t stream) {
  event->recorded = std::chrono::steady_clock::now();
  event->stream = stream;
  event->at = ++moments;
  event->waited = false;
  return cudaSuccess;
}
cudaError_t cudaEventSynchronize(cudaEvent_t event) {
  event->waited = true;
  return cudaSuccess;
}
// On a GPU, an event for which nothing has waited may not have happened yet.
cudaError_t cudaEventElapsedTime(float* ms, cudaEvent_t from, cudaEvent_t to) {
  const bool waited = to->waited || (to->stream != nullptr && to->stream->waited > to->at);
  if (!waited) return Told(cudaErrorNotReady);
  *ms = std::chrono::duration<float, std::milli>(to->recorded - from->recorded).count();
  return cudaSuccess;
}

cudaError_t SetFunctionAttribute(const void* function, cudaFuncAttribute, int value) {
  const size_t bytes = static_cast<size_t>(value);
  if (value < 0 || bytes > voxeld::simt::kSharedMost) return Told(cudaErrorInvalidValue);
  const std::lock_guard lock(voxeld::simt::shared_limits.mutex);
  voxeld::simt::shared_limits.bytes[function] = bytes;
  return cudaSuccess;
}
