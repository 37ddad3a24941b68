// The CPU's loop over voxels, in the processor's widest vectors; the bytes are the same for all
// widths.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "gpu/generate/batch.h"

namespace voxeld::gpu::generate {

// Writes voxels [first, first + count) of the batch from out[0] on; `offsets` are the plan's.
// `past_caches`: use streaming stores, for outputs that the caches would not keep.
void EmitVoxels(const Batch& batch, Format format, std::span<const uint64_t> offsets,
                uint64_t first, uint64_t count, bool past_caches, std::byte* out);

// The smallest and the greatest coordinates in units, and whether all of them are valid.
struct UnitBounds {
  double lo[3], hi[3];
  bool all_within = true;  // all are numbers within ±kMostCoordinate
};
// Writes the number of voxels of each of at most kBlockSegments segments into `counts`: 0 for a
// segment whose squared length is not below 2⁵³, which must be counted in another way.
void CountVoxels(const Batch& batch, Sampling sampling, size_t begin, size_t end, uint64_t* counts,
                 UnitBounds& bounds);

// Fills memory with streaming stores. Its speed is the upper limit for EmitVoxels.
void StreamingFill(std::span<std::byte> out, uint32_t word);

// Returns the name of the instruction set in use.
std::string VectorTarget();

}  // namespace voxeld::gpu::generate
