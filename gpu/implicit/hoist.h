// Splits a program's surface by the axes of voxel space: parts that depend on one axis alone are
// computed once for each place along it, rather than for each voxel. The operations and their
// arguments stay the same, so every value does too.
#pragma once

#include <cstdint>
#include <vector>

#include "gpu/implicit/hoisted.h"

namespace voxeld::gpu::implicit {

// Returns the hoisted program as words (hoisted.h). `depends[r]`: bits of the axes of voxel space
// that the shape's coordinate r depends on.
std::vector<uint32_t> Hoist(const ProgramView& program, const uint32_t depends[3]);

}  // namespace voxeld::gpu::implicit
