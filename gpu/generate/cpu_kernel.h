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

// Fills memory with streaming stores, the ceiling of the above.
void StreamingFill(std::span<std::byte> out, uint32_t word);

// The instruction set in use.
std::string VectorTarget();

}  // namespace voxeld::gpu::generate
