// Host memory that the device copies to and from directly.
#pragma once

#include <cstddef>
#include <span>

namespace voxeld::gpu::cuda {

// If memory cannot be pinned (no device, a limit of the system), copies are slower; there is no
// other effect.
void PinMemory(std::span<std::byte> memory);
void PinReadOnlyMemory(std::span<std::byte> memory);  // that this process cannot write
void UnpinMemory(std::span<std::byte> memory);

}  // namespace voxeld::gpu::cuda
