#include "tests/gpu/worker/illegal_address.h"

#include <cuda_runtime_api.h>

#include <cstdint>

namespace voxeld::gpu {
namespace {

__global__ void Write(uintptr_t address) { *reinterpret_cast<volatile int*>(address) = 1; }

}  // namespace

void WriteToAnIllegalAddress() {
  cudaStream_t stream = nullptr;
  if (cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking) != cudaSuccess) return;
  Write<<<1, 1, 0, stream>>>(16);
  cudaStreamSynchronize(stream);  // its error stays, for the next caller
}

}  // namespace voxeld::gpu
