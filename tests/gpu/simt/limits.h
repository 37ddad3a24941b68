// What a grid may have, as CUDA's devices limit it.
#pragma once

#include <cstdint>

#include "tests/gpu/simt/grid.h"

namespace voxeld::simt {

// If not, the next cudaGetLastError() says so.
bool IsAllowed(const Grid& grid);
// VOXELD_SEED, or the same as ever.
uint64_t Seed();

}  // namespace voxeld::simt
