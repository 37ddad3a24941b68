// What runs on the device. Each function queues its kernels in `stream` and answers whether that
// could be done; what goes wrong in them shows at the next synchronisation.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "gpu/cuda/line_types.h"

namespace voxeld::gpu::cuda {

// ---- the table (kernels_index.cu)
// table[slots[i]] = entries[i].
cudaError_t PutEntries(TableEntry* table, const TableEntry* entries, const uint32_t* slots,
                       uint32_t count, cudaStream_t stream);
cudaError_t PutFewEntries(TableEntry* table, const FewEntries& few, uint32_t count,
                          cudaStream_t stream);
// The table has moved: every record's address is set anew.
cudaError_t Rebase(TableEntry* table, uint32_t count, cudaStream_t stream);
// Places solids of the table anew: those of `slots`, each by map ∘ its own of `transforms`. Adds to `*singular` how many of them
// have no inverse.
cudaError_t MoveSolids(TableEntry* table, const uint32_t* slots, const Affine* transforms,
                       const Affine& map, uint32_t count, uint32_t* singular, cudaStream_t stream);
cudaError_t Kill(TableEntry* table, const uint32_t* slots, uint32_t count, cudaStream_t stream);

// ---- the index of tiles (kernels_index.cu)
// Marks every owned tile that items of the list may touch.
cudaError_t MarkTiles(const TableEntry* table, const ItemList& list, uint64_t items,
                      const VolumeView& volume, cudaStream_t stream);
// counts[i]: owned tiles that item `begin` + i may touch.
cudaError_t CountTiles(const TableEntry* table, const ItemList& list, uint64_t begin,
                       uint32_t items, const VolumeView& volume, uint32_t* counts,
                       cudaStream_t stream);
// offsets[i]: sum of counts[0..i), and of all at offsets[items]. `temp` null: only its size.
cudaError_t SumCounts(void* temp, size_t& temp_bytes, const uint32_t* counts, uint64_t* offsets,
                      uint32_t items, cudaStream_t stream);
// The pairs themselves; marks the tiles of drawables in layers that are drawn, unless volume.dirty is null.
cudaError_t FillPairs(const TableEntry* table, const LayerLook* layers, const ItemList& list,
                      uint64_t begin, uint32_t items, const uint64_t* offsets,
                      const VolumeView& volume, uint64_t* keys, uint64_t* values,
                      cudaStream_t stream);
// Sets `inside` (InsideRows, of the source's bounds, zeros before) to which voxels are inside of the source's triangles
// (kernels_filled.cu), and `tiles` to which of its items have any, each of which is a tile.
// Pointers of the source are the device's.
cudaError_t FindInside(const Source& source, const GeometryRecord& record, uint32_t* inside,
                       uint8_t* tiles, cudaStream_t stream);
// Pairs of items [begin, end) of the list and tiles in the blocks that `within` draws, in any order, of
// those items for which there is room; *count grows by how many there are.
cudaError_t AppendPairs(const TableEntry* table, const ItemList& list, uint64_t begin, uint64_t end,
                        const VolumeView& volume, const RegionGrid& within, uint64_t* keys,
                        uint64_t* values, uint64_t capacity, uint64_t* count, cudaStream_t stream);
// flags[i] is 1 if pair i is of a drawable that is alive; then they can be summed by SumCounts.
cudaError_t FlagLive(const TableEntry* table, const uint64_t* values, uint32_t pairs,
                     uint32_t* flags, cudaStream_t stream);
// Those with a flag, to their places.
cudaError_t PickLive(const uint64_t* keys, const uint64_t* values, const uint32_t* flags,
                     const uint64_t* offsets, uint32_t pairs, uint64_t* keys_out,
                     uint64_t* values_out, cudaStream_t stream);
// Sorts by key; the result is in the arrays that `swapped` names (true: the second ones). `temp`
// null: only its size.
cudaError_t SortPairs(void* temp, size_t& temp_bytes, uint64_t* keys, uint64_t* keys2,
                      uint64_t* values, uint64_t* values2, uint32_t pairs, int key_bits,
                      bool& swapped, cudaStream_t stream);
cudaError_t FindRows(const uint64_t* keys, uint32_t pairs, uint32_t tiles, uint32_t* row_begin,
                     cudaStream_t stream);

// ---- slicing (kernels_slice.cu)
// Owned slices [begin, begin + count), those that are dirty; they are clean afterwards, and their
// pictures carry `frame` if their bytes are not what they were, which is told at once: a copy would
// have to wait for those of pictures that are under way. `told`: null, or, with the last slices of a
// frame, where in the host's memory all that was counted goes; counting begins anew.
cudaError_t DrawSlices(const VolumeView& volume, const SliceIndexView& index, const SliceView& view,
                       uint32_t begin, uint32_t count, uint64_t frame, Counters* told,
                       cudaStream_t stream);
// The end of it, for pictures drawn already. `sampled`: that was done from tiles, so that slices
// which no lit tile reaches are blank.
cudaError_t EndSlices(const VolumeView& volume, const SliceIndexView& index, const SliceView& view,
                      uint32_t begin, uint32_t count, uint64_t frame, bool sampled, Counters* told,
                      cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
