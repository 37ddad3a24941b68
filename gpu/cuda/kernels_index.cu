// The table of drawables, and the index of which items may lie in which tiles.
#include <thrust/iterator/transform_iterator.h>

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <cuda/std/functional>

#include "gpu/cuda/items-inl.h"
#include "gpu/cuda/kernels.h"
#include "gpu/cuda/line_types.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = kItemThreads;

// Calls f(slot, entry, item, tile) for each owned tile that item `i` of the row may touch.
template <typename F>
__device__ void ForTiles(const TableEntry* table, const ItemList& list, uint64_t i,
                         const VolumeView& volume, F&& f) {
  const uint32_t d = DrawableOf(list, i);
  const uint32_t slot = list.slot(d);
  const uint32_t item = static_cast<uint32_t>(i - list.first(d));
  const TableEntry& entry = table[slot];
  if (entry.record.kind == kDrawnByCpu) return f(slot, entry, item, entry.drawn.tiles[item]);
  WithPrimitive(entry.record.kind, [&](auto primitive) {
    decltype(primitive)::type::EmitTiles(entry.source, item, volume.grid, [&](uint32_t tile) {
      if (volume.owned[tile] != 0) f(slot, entry, item, tile);
    });
  });
}

__global__ void PutEntriesKernel(TableEntry* table, const TableEntry* entries,
                                 const uint32_t* slots, uint32_t count) {
  const uint64_t i = Thread();
  if (i >= count) return;
  TableEntry& to = table[slots[i]];
  to = entries[i];
  to.source.record = &to.record;
}

__global__ void PutFewEntriesKernel(TableEntry* table, const __grid_constant__ FewEntries few,
                                    uint32_t count) {
  PutFew(table, few, count);
}

__global__ void RebaseKernel(TableEntry* table, uint32_t count) {
  const uint64_t i = Thread();
  if (i < count) table[i].source.record = &table[i].record;
}

__global__ void MoveSolidsKernel(TableEntry* table, const uint32_t* slots, const Affine* transforms,
                                 const __grid_constant__ Affine map, uint32_t count,
                                 uint32_t* singular) {
  const uint64_t i = Thread();
  if (i >= count) return;
  TableEntry& entry = table[slots[i]];
  WithPrimitive(entry.record.kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    if constexpr (kIsSolid<Primitive>) {
      entry.source.solid =
          Solid::Of(Compose(Compose(map, transforms[i]), Primitive::CanonicalMap(entry.record)));
    }
  });
  if (!entry.source.solid.drawable) atomicAdd(singular, 1u);
}

__global__ void KillKernel(TableEntry* table, const uint32_t* slots, uint32_t count) {
  const uint64_t i = Thread();
  if (i < count) table[slots[i]].alive = 0;
}

__global__ void MarkTilesKernel(const TableEntry* table, ItemList list, uint64_t items,
                                VolumeView volume) {
  const uint64_t stride = static_cast<uint64_t>(gridDim.x) * blockDim.x;
  for (uint64_t i = Thread(); i < items; i += stride) {
    ForTiles(table, list, i, volume,
             [&](uint32_t, const TableEntry&, uint32_t, uint32_t tile) { volume.dirty[tile] = 1; });
  }
}

__global__ void CountTilesKernel(const TableEntry* table, ItemList list, uint64_t begin,
                                 uint32_t items, VolumeView volume, uint32_t* counts) {
  const uint64_t i = Thread();
  if (i >= items) return;
  uint32_t count = 0;
  ForTiles(table, list, begin + i, volume,
           [&](uint32_t, const TableEntry&, uint32_t, uint32_t) { ++count; });
  counts[i] = count;
}

__global__ void FillPairsKernel(const TableEntry* table, const LayerLook* layers, ItemList list,
                                uint64_t begin, uint32_t items, const uint64_t* offsets,
                                VolumeView volume, uint64_t* keys, uint64_t* values) {
  const uint64_t i = Thread();
  if (i >= items) return;
  uint64_t at = offsets[i];
  ForTiles(table, list, begin + i, volume,
           [&](uint32_t slot, const TableEntry& entry, uint32_t item, uint32_t tile) {
             keys[at] = PairKey(tile, entry.layer);
             values[at] = PairValue(slot, item);
             ++at;
             if (volume.dirty != nullptr && layers[entry.layer].drawn != 0) {
               volume.dirty[tile] = 1;
             }
           });
}

__global__ void AppendPairsKernel(const TableEntry* table, ItemList list, uint64_t begin,
                                  uint64_t end, VolumeView volume, RegionGrid within,
                                  uint64_t* keys, uint64_t* values, uint64_t capacity,
                                  unsigned long long* count) {
  const uint64_t stride = static_cast<uint64_t>(gridDim.x) * blockDim.x;
  const auto drawn = [&](uint32_t tile) {
    int32_t at[3];
    volume.grid.Coordinates(tile, at);
    for (int a = 0; a < 3; ++a) at[a] = at[a] * kTileSize >> (RegionBits(a) + kBlockBits);
    return within.DrawsBlock(at);
  };
  for (uint64_t i = begin + Thread(); i < end; i += stride) {
    // The place for all pairs of an item is reserved by one addition. With an addition for each
    // pair within the walk, some additions were lost when ptxas 13.0 optimised this kernel for
    // compute capability 9.0, different ones in each run; none were lost without its optimisation,
    // and none in other kernels that add outside such a walk.
    unsigned long long pairs = 0;
    ForTiles(table, list, i, volume,
             [&](uint32_t, const TableEntry&, uint32_t, uint32_t tile) { pairs += drawn(tile); });
    if (pairs == 0) continue;
    uint64_t place = atomicAdd(count, pairs);
    const uint64_t all = place + pairs;
    if (all > capacity) continue;
    ForTiles(table, list, i, volume,
             [&](uint32_t slot, const TableEntry& entry, uint32_t item, uint32_t tile) {
               if (!drawn(tile)) return;
               keys[place] = PairKey(tile, entry.layer);
               values[place] = PairValue(slot, item);
               ++place;
             });
  }
}

__global__ void FlagLiveKernel(const TableEntry* table, const uint64_t* values, uint32_t pairs,
                               uint32_t* flags) {
  const uint64_t i = Thread();
  if (i < pairs) flags[i] = table[values[i] >> 32].alive;
}

__global__ void PickLiveKernel(const uint64_t* keys, const uint64_t* values, const uint32_t* flags,
                               const uint64_t* offsets, uint32_t pairs, uint64_t* keys_out,
                               uint64_t* values_out) {
  const uint64_t i = Thread();
  if (i >= pairs || flags[i] == 0) return;
  keys_out[offsets[i]] = keys[i];
  values_out[offsets[i]] = values[i];
}

struct Widen {
  __host__ __device__ uint64_t operator()(uint32_t count) const { return count; }
};

__global__ void FindRowsKernel(const uint64_t* keys, uint32_t pairs, uint32_t tiles,
                               uint32_t* row_begin) {
  const uint64_t tile = Thread();
  if (tile > tiles) return;
  uint32_t low = 0, high = pairs;  // the first pair of this tile or a later one
  while (low < high) {
    const uint32_t middle = low + (high - low) / 2;
    if (keys[middle] >> kLayerBits < tile) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  row_begin[tile] = low;
}

// Returns the number of blocks for threads that take items in turn.
uint32_t SomeBlocks(uint64_t items) {
  constexpr uint64_t kMostBlocks = 1 << 16;
  return static_cast<uint32_t>(Min((items + kThreads - 1) / kThreads, kMostBlocks));
}

}  // namespace

cudaError_t PutEntries(TableEntry* table, const TableEntry* entries, const uint32_t* slots,
                       uint32_t count, cudaStream_t stream) {
  PutEntriesKernel<<<Blocks(count), kThreads, 0, stream>>>(table, entries, slots, count);
  return cudaGetLastError();
}

cudaError_t PutFewEntries(TableEntry* table, const FewEntries& few, uint32_t count,
                          cudaStream_t stream) {
  PutFewEntriesKernel<<<1, kThreads, 0, stream>>>(table, few, count);
  return cudaGetLastError();
}

cudaError_t Rebase(TableEntry* table, uint32_t count, cudaStream_t stream) {
  RebaseKernel<<<Blocks(count), kThreads, 0, stream>>>(table, count);
  return cudaGetLastError();
}

cudaError_t MoveSolids(TableEntry* table, const uint32_t* slots, const Affine* transforms,
                       const Affine& map, uint32_t count, uint32_t* singular, cudaStream_t stream) {
  MoveSolidsKernel<<<Blocks(count), kThreads, 0, stream>>>(table, slots, transforms, map, count,
                                                           singular);
  return cudaGetLastError();
}

cudaError_t Kill(TableEntry* table, const uint32_t* slots, uint32_t count, cudaStream_t stream) {
  KillKernel<<<Blocks(count), kThreads, 0, stream>>>(table, slots, count);
  return cudaGetLastError();
}

cudaError_t MarkTiles(const TableEntry* table, const ItemList& list, uint64_t items,
                      const VolumeView& volume, cudaStream_t stream) {
  MarkTilesKernel<<<SomeBlocks(items), kThreads, 0, stream>>>(table, list, items, volume);
  return cudaGetLastError();
}

cudaError_t AppendPairs(const TableEntry* table, const ItemList& list, uint64_t begin, uint64_t end,
                        const VolumeView& volume, const RegionGrid& within, uint64_t* keys,
                        uint64_t* values, uint64_t capacity, uint64_t* count, cudaStream_t stream) {
  AppendPairsKernel<<<SomeBlocks(end - begin), kThreads, 0, stream>>>(
      table, list, begin, end, volume, within, keys, values, capacity,
      reinterpret_cast<unsigned long long*>(count));
  return cudaGetLastError();
}

cudaError_t CountTiles(const TableEntry* table, const ItemList& list, uint64_t begin,
                       uint32_t items, const VolumeView& volume, uint32_t* counts,
                       cudaStream_t stream) {
  CountTilesKernel<<<Blocks(items), kThreads, 0, stream>>>(table, list, begin, items, volume,
                                                           counts);
  return cudaGetLastError();
}

cudaError_t SumCounts(void* temp, size_t& temp_bytes, const uint32_t* counts, uint64_t* offsets,
                      uint32_t items, cudaStream_t stream) {
  if (temp != nullptr) {
    const cudaError_t error = cudaMemsetAsync(offsets, 0, sizeof(*offsets), stream);
    if (error != cudaSuccess) return error;
  }
  return cub::DeviceScan::InclusiveScan(temp, temp_bytes,
                                        thrust::make_transform_iterator(counts, Widen{}),
                                        offsets + 1, ::cuda::std::plus<uint64_t>{}, items, stream);
}

cudaError_t FillPairs(const TableEntry* table, const LayerLook* layers, const ItemList& list,
                      uint64_t begin, uint32_t items, const uint64_t* offsets,
                      const VolumeView& volume, uint64_t* keys, uint64_t* values,
                      cudaStream_t stream) {
  FillPairsKernel<<<Blocks(items), kThreads, 0, stream>>>(table, layers, list, begin, items,
                                                          offsets, volume, keys, values);
  return cudaGetLastError();
}

cudaError_t FlagLive(const TableEntry* table, const uint64_t* values, uint32_t pairs,
                     uint32_t* flags, cudaStream_t stream) {
  FlagLiveKernel<<<Blocks(pairs), kThreads, 0, stream>>>(table, values, pairs, flags);
  return cudaGetLastError();
}

cudaError_t PickLive(const uint64_t* keys, const uint64_t* values, const uint32_t* flags,
                     const uint64_t* offsets, uint32_t pairs, uint64_t* keys_out,
                     uint64_t* values_out, cudaStream_t stream) {
  PickLiveKernel<<<Blocks(pairs), kThreads, 0, stream>>>(keys, values, flags, offsets, pairs,
                                                         keys_out, values_out);
  return cudaGetLastError();
}

cudaError_t SortPairs(void* temp, size_t& temp_bytes, uint64_t* keys, uint64_t* keys2,
                      uint64_t* values, uint64_t* values2, uint32_t pairs, int key_bits,
                      bool& swapped, cudaStream_t stream) {
  cub::DoubleBuffer<uint64_t> k(keys, keys2), v(values, values2);
  const cudaError_t error =
      cub::DeviceRadixSort::SortPairs(temp, temp_bytes, k, v, pairs, 0, key_bits, stream);
  swapped = k.selector != 0;
  return error;
}

cudaError_t FindRows(const uint64_t* keys, uint32_t pairs, uint32_t tiles, uint32_t* row_begin,
                     cudaStream_t stream) {
  FindRowsKernel<<<Blocks(tiles + 1), kThreads, 0, stream>>>(keys, pairs, tiles, row_begin);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
