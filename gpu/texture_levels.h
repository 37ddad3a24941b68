// Computes the levels of a texture (gpu/primitives/texture.h) from its first level.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld::gpu {

// texels: TexelCount(width, height) texels as 0x00RRGGBB, of which the first width × height are
// filled in. Fills in the others: each is the mean, with halves rounded up, of the four texels that
// it stands for, or of two if a side is 1.
void FillLevels(uint32_t width, uint32_t height, std::span<uint32_t> texels);

}  // namespace voxeld::gpu
