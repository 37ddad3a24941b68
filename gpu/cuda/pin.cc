#include "gpu/cuda/pin.h"

#include <cuda_runtime_api.h>

namespace voxeld::gpu::cuda {

void PinMemory(std::span<std::byte> memory) {
  if (cudaHostRegister(memory.data(), memory.size(), cudaHostRegisterDefault) != cudaSuccess) {
    cudaGetLastError();
  }
}

void UnpinMemory(std::span<std::byte> memory) {
  if (cudaHostUnregister(memory.data()) != cudaSuccess) cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
