// The engine's kernels. Each function queues its kernels in `stream` and returns whether that
// succeeded; errors in the kernels appear at the next synchronisation.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "gpu/cuda/line_types.h"

namespace voxeld::gpu::cuda {

// ---- the table (kernels_index.cu)
// Sets table[slots[i]] = entries[i].
cudaError_t PutEntries(TableEntry* table, const TableEntry* entries, const uint32_t* slots,
                       uint32_t count, cudaStream_t stream);
cudaError_t PutFewEntries(TableEntry* table, const FewEntries& few, uint32_t count,
                          cudaStream_t stream);
// Sets every record's address again, after the table has moved.
cudaError_t Rebase(TableEntry* table, uint32_t count, cudaStream_t stream);
// Places solids of the table again: those of `slots`, each by map ∘ its own of `transforms`. Adds
// to `*singular` how many of them have no inverse.
cudaError_t MoveSolids(TableEntry* table, const uint32_t* slots, const Affine* transforms,
                       const Affine& map, uint32_t count, uint32_t* singular, cudaStream_t stream);
cudaError_t Kill(TableEntry* table, const uint32_t* slots, uint32_t count, cudaStream_t stream);

// ---- the index of tiles (kernels_index.cu)
// Marks every owned tile that items of the list may touch.
cudaError_t MarkTiles(const TableEntry* table, const ItemList& list, uint64_t items,
                      const VolumeView& volume, cudaStream_t stream);
// Sets counts[i] to the number of owned tiles that item `begin` + i may touch.
cudaError_t CountTiles(const TableEntry* table, const ItemList& list, uint64_t begin,
                       uint32_t items, const VolumeView& volume, uint32_t* counts,
                       cudaStream_t stream);
// Sets offsets[i] to the sum of counts[0..i), and offsets[items] to the sum of all. If `temp` is
// null, only computes its size.
cudaError_t SumCounts(void* temp, size_t& temp_bytes, const uint32_t* counts, uint64_t* offsets,
                      uint32_t items, cudaStream_t stream);
// Writes the pairs; marks the tiles of drawables in layers that are drawn, unless volume.dirty is
// null.
cudaError_t FillPairs(const TableEntry* table, const LayerLook* layers, const ItemList& list,
                      uint64_t begin, uint32_t items, const uint64_t* offsets,
                      const VolumeView& volume, uint64_t* keys, uint64_t* values,
                      cudaStream_t stream);
// Sets `inside` (InsideRows of the source's bounds, initially zeros) to the voxels that are inside
// the source's triangles (kernels_filled.cu), and `tiles` to which of its items have any; each item
// is a tile. The source's pointers are device addresses.
cudaError_t FindInside(const Source& source, const GeometryRecord& record, uint32_t* inside,
                       uint8_t* tiles, cudaStream_t stream);
// Appends the pairs of items [begin, end) of the list and tiles in the blocks that `within` draws,
// in any order, for those items that fit; *count grows by the number of all pairs.
cudaError_t AppendPairs(const TableEntry* table, const ItemList& list, uint64_t begin, uint64_t end,
                        const VolumeView& volume, const RegionGrid& within, uint64_t* keys,
                        uint64_t* values, uint64_t capacity, uint64_t* count, cudaStream_t stream);
// Sets flags[i] to 1 if pair i is of a drawable that is alive; SumCounts can then sum them.
cudaError_t FlagLive(const TableEntry* table, const uint64_t* values, uint32_t pairs,
                     uint32_t* flags, cudaStream_t stream);
// Copies the pairs with a flag to their places.
cudaError_t PickLive(const uint64_t* keys, const uint64_t* values, const uint32_t* flags,
                     const uint64_t* offsets, uint32_t pairs, uint64_t* keys_out,
                     uint64_t* values_out, cudaStream_t stream);
// Sorts by key; the result is in the arrays that `swapped` selects (true: the second ones). If
// `temp` is null, only computes its size.
cudaError_t SortPairs(void* temp, size_t& temp_bytes, uint64_t* keys, uint64_t* keys2,
                      uint64_t* values, uint64_t* values2, uint32_t pairs, int key_bits,
                      bool& swapped, cudaStream_t stream);
cudaError_t FindRows(const uint64_t* keys, uint32_t pairs, uint32_t tiles, uint32_t* row_begin,
                     cudaStream_t stream);

// ---- slicing (kernels_slice.cu)
// Draws the dirty ones of the owned slices [begin, begin + count). They are clean afterwards, and
// slice images whose bytes changed carry `frame`. This is written to the host's memory at once: a
// copy would have to wait for the copies of slice images in progress. `told`: null, or, with the
// last slices of a frame, where in the host's memory the counters go; counting then starts again.
cudaError_t DrawSlices(const VolumeView& volume, const SliceIndexView& index, const SliceView& view,
                       uint32_t begin, uint32_t count, uint64_t frame, Counters* told,
                       cudaStream_t stream);
// Does the final part of DrawSlices for slice images that are already drawn. `sampled`: they were
// sampled from tiles, so slices that no lit tile reaches are blank.
cudaError_t EndSlices(const VolumeView& volume, const SliceIndexView& index, const SliceView& view,
                      uint32_t begin, uint32_t count, uint64_t frame, bool sampled, Counters* told,
                      cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
