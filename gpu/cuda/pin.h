// Host memory that the device copies to and from directly.
#pragma once

#include <cstddef>
#include <span>

namespace voxeld::gpu::cuda {

// Where it cannot be had (no device, a limit of the system), copies are slower, nothing else.
void PinMemory(std::span<std::byte> memory);
void PinReadOnlyMemory(std::span<std::byte> memory);  // that this process cannot write
void UnpinMemory(std::span<std::byte> memory);

}  // namespace voxeld::gpu::cuda
