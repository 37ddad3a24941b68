#include "gpu/cuda/pin.h"

#include <cuda_runtime_api.h>

namespace voxeld::gpu::cuda {

namespace {

void Register(std::span<std::byte> memory, unsigned flags) {
  if (cudaHostRegister(memory.data(), memory.size(), flags) != cudaSuccess) cudaGetLastError();
}

}  // namespace

void PinMemory(std::span<std::byte> memory) { Register(memory, cudaHostRegisterDefault); }

void PinReadOnlyMemory(std::span<std::byte> memory) { Register(memory, cudaHostRegisterReadOnly); }

void UnpinMemory(std::span<std::byte> memory) {
  if (cudaHostUnregister(memory.data()) != cudaSuccess) cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
