// Finds which bricks of a grid of samples (primitives/samples.h) may contain something, so that all
// others are skipped.
#pragma once

#include <cstdint>
#include <span>

#include "gpu/delta.h"

namespace voxeld::gpu {

// Returns the number of words of a grid with `size` samples along each axis, its bricks included.
uint64_t SampleWords(const uint32_t size[3], uint32_t format);
uint32_t BrickWords(const uint32_t size[3]);

// Sets the brick bits of `words`, whose head, table and samples are already filled in. Of `record`,
// fill and thickness are used. A bit that is not set guarantees that no voxel is covered if only
// samples of such bricks lie around its centre, up to one voxel further on each side.
void FillBricks(const GeometryRecord& record, std::span<uint32_t> words);

}  // namespace voxeld::gpu
