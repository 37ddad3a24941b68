// A program's surface parted by the axes of voxel space: what depends on one axis alone is computed
// once for each place along it, rather than for each voxel. The operations and their arguments stay the
// same, so every value does.
#pragma once

#include <cstdint>
#include <vector>

#include "gpu/implicit/hoisted.h"

namespace voxeld::gpu::implicit {

// `depends[r]`: bits of the axes of voxel space that the shape's coordinate r depends on. What hoisted.h
// says, as words.
std::vector<uint32_t> Hoist(const ProgramView& program, const uint32_t depends[3]);

}  // namespace voxeld::gpu::implicit
