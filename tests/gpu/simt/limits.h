// The limits of a grid, like those of CUDA's devices.
#pragma once

#include <cstdint>

#include "tests/gpu/simt/grid.h"

namespace voxeld::simt {

// Returns whether the grid is allowed. If not, the next cudaGetLastError() says so.
bool IsAllowed(const Grid& grid);
// Returns VOXELD_SEED, or a constant.
uint64_t Seed();

}  // namespace voxeld::simt
