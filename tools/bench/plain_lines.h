// The loop that assembly of lines is measured against.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld::bench {

// Six coordinates a line, all of them inside `size`; a colour a line. Writes into a dense array, x fastest, at every
// step of the axis along which the line is longest the voxel whose centre is nearest; returns how many.
uint64_t DrawPlainLines(std::span<const float> positions, std::span<const uint32_t> colors,
                        const int32_t size[3], uint32_t* dense);

}  // namespace voxeld::bench
