// Which bricks of a grid of samples (primitives/samples.h) may have something, so that all else is passed over.
#pragma once

#include <cstdint>
#include <span>

#include "gpu/delta.h"

namespace voxeld::gpu {

// Words of a grid with so many samples along each axis, its bricks included.
uint64_t SampleWords(const uint32_t size[3], uint32_t format);
uint32_t BrickWords(const uint32_t size[3]);

// Sets the bits of `words`, whose head, table and samples are there. `record`: fill and thickness. A bit that
// is not set promises that no voxel is covered around whose centre, one voxel further on each side, there are
// only samples of such bricks.
void FillBricks(const GeometryRecord& record, std::span<uint32_t> words);

}  // namespace voxeld::gpu
