// The levels of a texture (gpu/primitives/texture.h), made of its first.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld::gpu {

// texels: TexelCount(width, height), of which the first width × height are there, 0x00RRGGBB. Fills in the others: each is
// the mean of the four texels, or two if a side is 1, that it stands for, halves rounded up.
void FillLevels(uint32_t width, uint32_t height, std::span<uint32_t> texels);

}  // namespace voxeld::gpu
