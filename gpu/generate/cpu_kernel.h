// The CPU's loop over voxels, in the widest vectors that the processor has; the same bytes in all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "gpu/generate/batch.h"

namespace voxeld::gpu::generate {

// Voxels [first, first + count) of the batch, from out[0] on; `offsets` are the plan's. `past_caches`: by
// streaming stores, for outputs that the caches would not keep.
void EmitVoxels(const Batch& batch, Format format, std::span<const uint64_t> offsets,
                uint64_t first, uint64_t count, bool past_caches, std::byte* out);

// The smallest and the greatest coordinates in units, or what is no coordinate.
struct UnitBounds {
  double lo[3], hi[3];
  bool all_within = true;  // ±kMostCoordinate, and numbers
};
// Voxels of each of at most kBlockSegments segments into `counts`: 0 for one that is too long for 2⁵³ to hold
// its square, which must be counted otherwise.
void CountVoxels(const Batch& batch, Sampling sampling, size_t begin, size_t end, uint64_t* counts,
                 UnitBounds& bounds);

// Fills memory with streaming stores, the ceiling of the above.
void StreamingFill(std::span<std::byte> out, uint32_t word);

// The instruction set in use.
std::string VectorTarget();

}  // namespace voxeld::gpu::generate
