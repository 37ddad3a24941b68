// Points without thickness: made from drawables' items, and sorted by region.
#include <cub/block/block_scan.cuh>

#include "gpu/cuda/lines-inl.h"
#include "gpu/cuda/point_kernels.h"
#include "gpu/cuda/warp-inl.h"

namespace voxeld::gpu::cuda {
namespace {

__device__ PlacedPoint LoadPoint(const PlacedPoint* point) {
  const uint2 two = *reinterpret_cast<const uint2*>(point);
  return {two.x, two.y};
}
__device__ void StorePoint(PlacedPoint point, PlacedPoint* to) {
  *reinterpret_cast<uint2*>(to) = make_uint2(point.at, point.word);
}

// ------------------------------------------------------------------------------------------ making

__device__ PlacedPoint Placed(const RegionGrid& grid, const int32_t voxel[3], uint32_t word) {
  int32_t region[3], block[3];
  for (int a = 0; a < 3; ++a) {
    region[a] = voxel[a] >> RegionBits(a);
    block[a] = region[a] >> kBlockBits;
  }
  if (!grid.DrawsBlock(block)) return {};
  return PlacedPoint::Of(grid.RegionAt(region), voxel, word);
}

// Makes a point from any source.
__device__ PlacedPoint MakePoint(const TableEntry& entry, uint32_t item, const RegionGrid& grid) {
  const Line point = Points::ItemOf(entry.source, item);
  int32_t voxel[3];
  for (int a = 0; a < 3; ++a) voxel[a] = static_cast<int32_t>(VoxelOf(point.s[a]));
  return Placed(grid, voxel, MakeWord(entry.priority, entry.erase != 0, point.color_s));
}

constexpr uint32_t kMakeThreads = 256;
constexpr uint32_t kMadeEach = 8;  // per thread
constexpr uint32_t kMadeByBlock = kMakeThreads * kMadeEach;
constexpr uint32_t kMadeAtOnce = 4;  // of these, loaded together
static_assert(kMadeEach % kMadeAtOnce == 0);

// Makes items `item` + e·kMakeThreads that are less than `end`; `to` is the place of the first. For
// positions in arrays, without vertices.
__device__ void MakeSome(const TableEntry& entry, uint32_t item, uint32_t end,
                         const RegionGrid& grid, PlacedPoint* to) {
  const Source& source = entry.source;
  const Affine map = source.map;
  const float* const positions = source.positions;
  const uint32_t* const colors =
      source.record->color_mode == ColorMode::kPerVertex ? source.colors : nullptr;
  const uint32_t color = source.record->color, tint = source.tint, priority = entry.priority;
  const bool erase = entry.erase != 0;
#pragma unroll 1
  for (uint32_t e = 0; e < kMadeEach; e += kMadeAtOnce) {
    float position[kMadeAtOnce][3];
    uint32_t rgb[kMadeAtOnce];
#pragma unroll
    for (uint32_t i = 0; i < kMadeAtOnce; ++i) {
      const uint32_t vertex = item + (e + i) * kMakeThreads;
      const bool here = vertex < end;
      const float* const from = positions + static_cast<size_t>(vertex) * 3;
#pragma unroll
      for (int a = 0; a < 3; ++a) position[i][a] = here ? __ldg(from + a) : 0.0f;
      rgb[i] = here && colors != nullptr ? __ldg(colors + vertex) : color;
    }
#pragma unroll
    for (uint32_t i = 0; i < kMadeAtOnce; ++i) {
      const uint32_t offset = (e + i) * kMakeThreads;
      if (item + offset >= end) continue;
      int32_t voxel[3];
      VoxelOfPoint(map, position[i], voxel);
      StorePoint(Placed(grid, voxel, MakeWord(priority, erase, Tinted(rgb[i], tint))), to + offset);
    }
  }
}

__global__ void __launch_bounds__(kMakeThreads)
    MakePointsKernel(const TableEntry* table, const __grid_constant__ ItemList list, uint32_t items,
                     const __grid_constant__ RegionGrid grid, PlacedPoint* points) {
  const uint64_t first = static_cast<uint64_t>(blockIdx.x) * kMadeByBlock;
  const uint64_t end = Min<uint64_t>(first + kMadeByBlock, items);
  const uint32_t d = DrawableOf(list, first);
  const uint64_t begin = list.first(d);
  const TableEntry& entry = table[list.slot(d)];
  // Usually all are of one drawable.
  if (end <= list.first(d + 1) && entry.source.vertices == nullptr &&
      entry.source.record->index_count == 0) {
    MakeSome(entry, static_cast<uint32_t>(first - begin) + threadIdx.x,
             static_cast<uint32_t>(end - begin), grid, points + first + threadIdx.x);
    return;
  }
  for (uint64_t i = first + threadIdx.x; i < end; i += kMakeThreads) {
    const uint32_t of = DrawableOf(list, i);
    StorePoint(MakePoint(table[list.slot(of)], static_cast<uint32_t>(i - list.first(of)), grid),
               &points[i]);
  }
}

__global__ void CopyPointsKernel(ItemList list, uint64_t first, uint32_t count,
                                 const PlacedPoint* from, PlacedPoint* to) {
  const uint64_t i = Thread();
  if (i < count) StorePoint(LoadPoint(&from[PlaceOf(list, first + i)]), &to[first + i]);
}

// ----------------------------------------------------------------------------------------- sorting

constexpr uint32_t kRegionsEach = 8;  // that a thread sums at once

__global__ void CountPointsKernel(const PlacedPoint* points, uint32_t count, RegionGrid within,
                                  uint32_t* found) {
  const uint64_t i = Thread();
  bool here = false;
  if (i < count) {
    const PlacedPoint point = LoadPoint(&points[i]);
    here = point.word != 0 && within.Draws(point.region());
  }
  const uint32_t lanes = __ballot_sync(kAllLanes, here);
  if (threadIdx.x % 32 == 0 && lanes != 0) atomicAdd(found, static_cast<uint32_t>(__popc(lanes)));
}

// A chunk's records in order; after them, in 16 bits for each region: its number of records, then
// the place of the next.
__device__ unsigned char* SortMemory() {
  extern __shared__ __align__(16) unsigned char sort_memory[];
  return sort_memory;
}

// Counts one more in 16 bits; returns the count before.
__device__ uint32_t CountOne(uint32_t* counts, uint32_t l) {
  const uint32_t shift = l % 2 * 16;
  return atomicAdd(&counts[l / 2], 1u << shift) >> shift & 0xFFFF;
}

// Notes which of kRegionsEach regions from the l-th on have any (the bits in `any`), and marks
// those as dirty that were not noted before. Called by whole warps; a block of regions has 8 lanes.
__device__ void NoteRegions(const PointSort& sort, uint32_t l, uint32_t any) {
  static_assert(kRegionsInBlock == 8 * kRegionsEach);
  const uint32_t lane = threadIdx.x % 32, shift = lane % 8 * kRegionsEach;
  uint64_t all = static_cast<uint64_t>(any) << shift;
  for (int lanes = 4; lanes > 0; lanes /= 2) all |= __shfl_xor_sync(kAllLanes, all, lanes);
  uint32_t block = 0;
  uint64_t fresh = 0;
  if (lane % 8 == 0 && all != 0) {
    block = sort.within.DrawnBlock(l / kRegionsInBlock);
    uint64_t& bits = sort.regions[block];
    // Most bits are already set.
    fresh = all & ~*static_cast<const volatile uint64_t*>(&bits);
    if (fresh != 0) {
      fresh &= ~static_cast<uint64_t>(atomicOr(reinterpret_cast<unsigned long long*>(&bits),
                                               static_cast<unsigned long long>(fresh)));
    }
  }
  if (sort.dirty == nullptr) return;
  block = __shfl_sync(kAllLanes, block, lane & ~7u);
  fresh = __shfl_sync(kAllLanes, fresh, lane & ~7u);
  uint8_t* const dirty = sort.dirty + static_cast<size_t>(block) * kRegionsInBlock + shift;
  for (uint32_t i = 0; i < kRegionsEach; ++i) {
    if ((fresh >> (shift + i) & 1) != 0) dirty[i] = 1;
  }
}

// Converts the number of points in each drawn region to the place of its first point; writes it to
// the lists too. Returns the number of all points.
__device__ uint32_t SumRegions(const PointSort& sort, uint32_t chunk, uint32_t regions,
                               uint32_t* counts) {
  using Scan = cub::BlockScan<uint32_t, kPointThreads>;
  __shared__ typename Scan::TempStorage scan;
  uint16_t* const offsets = sort.offsets + static_cast<size_t>(chunk) * PointStride(regions);
  uint32_t total = 0;
  for (uint32_t first = 0; first < regions; first += kPointThreads * kRegionsEach) {
    const uint32_t l = first + threadIdx.x * kRegionsEach;
    uint4* const place = reinterpret_cast<uint4*>(counts + l / 2);
    const uint4 four = l < regions ? *place : make_uint4(0, 0, 0, 0);
    const uint32_t pairs[4] = {four.x, four.y, four.z, four.w};
    uint32_t sum = 0, any = 0;
#pragma unroll
    for (uint32_t i = 0; i < 4; ++i) {
      const uint32_t low = pairs[i] & 0xFFFF, high = pairs[i] >> 16;
      sum += low + high;
      any |= (low != 0 ? 1u : 0u) << 2 * i | (high != 0 ? 2u : 0u) << 2 * i;
    }
    uint32_t at, all;
    Scan(scan).ExclusiveSum(sum, at, all);
    at += total;
    total += all;
    uint32_t begins[4];
#pragma unroll
    for (uint32_t i = 0; i < 4; ++i) {
      const uint32_t low = pairs[i] & 0xFFFF, high = pairs[i] >> 16;
      begins[i] = at | (at + low) << 16;
      at += low + high;
    }
    if (l < regions) {
      const uint4 sums = make_uint4(begins[0], begins[1], begins[2], begins[3]);
      *place = sums;
      *reinterpret_cast<uint4*>(offsets + l) = sums;
    }
    NoteRegions(sort, l, any);
    __syncthreads();
  }
  if (threadIdx.x == 0) offsets[regions] = static_cast<uint16_t>(total);
  return total;
}

// Sorts a chunk of points, of which each thread has some. Called by the whole block; `counts` are 0
// and visible to all threads. kAll: all regions are drawn.
template <uint32_t kEach, bool kAll>
__device__ __forceinline__ void SortChunk(const PointSort& sort, uint32_t chunk, uint32_t regions,
                                          PlacedPoint mine[kEach]) {
  __shared__ uint32_t shared_base;
  PlacedPoint* const sorted = reinterpret_cast<PlacedPoint*>(SortMemory());
  uint32_t* const counts = reinterpret_cast<uint32_t*>(sorted + kPointThreads * kEach);
#pragma unroll
  for (uint32_t e = 0; e < kEach; ++e) {
    if (mine[e].word == 0) continue;
    if constexpr (!kAll) {
      const uint32_t region = mine[e].region();
      if (!sort.within.Draws(region)) {
        mine[e].word = 0;
        continue;
      }
      mine[e].at = sort.within.NumberDrawn(region) << PlacedPoint::kRegionShift | mine[e].voxel();
    }
    CountOne(counts, mine[e].region());
  }
  __syncthreads();
  const uint32_t total = SumRegions(sort, chunk, regions, counts);
  if (threadIdx.x == 0) {
    uint32_t base = chunk * kPointThreads * kEach;
    if (sort.again) {
      base = sort.base[chunk];
    } else if (sort.taken != nullptr) {
      base = atomicAdd(sort.taken, total);
    }
    shared_base = sort.base[chunk] = base;
    sort.touched[chunk] = 0;
  }
#pragma unroll
  for (uint32_t e = 0; e < kEach; ++e) {
    if (mine[e].word == 0) continue;
    StorePoint({mine[e].voxel(), mine[e].word}, &sorted[CountOne(counts, mine[e].region())]);
  }
  __syncthreads();
  const uint32_t base = shared_base;
  for (uint32_t i = threadIdx.x; i < total; i += kPointThreads) {
    if (base + i < sort.capacity) StorePoint(LoadPoint(&sorted[i]), &sort.records[base + i]);
  }
}

template <uint32_t kEach>
__device__ void ClearCounts(uint32_t regions) {
  uint32_t* const counts =
      reinterpret_cast<uint32_t*>(SortMemory() + sizeof(PlacedPoint) * kPointThreads * kEach);
  for (uint32_t i = threadIdx.x; i < regions / 2; i += kPointThreads) counts[i] = 0;
}

template <uint32_t kEach, bool kAll>
__global__ void __launch_bounds__(kPointThreads)
    SortPointsKernel(const __grid_constant__ PointSort sort, const PlacedPoint* points,
                     uint32_t count) {
  constexpr uint32_t kChunk = kPointThreads * kEach;
  const uint32_t regions = sort.within.drawn_count();
  const uint32_t chunks = static_cast<uint32_t>((uint64_t{count} + kChunk - 1) / kChunk);
  for (uint32_t chunk = blockIdx.x; chunk < chunks; chunk += gridDim.x) {
    if (sort.again && sort.touched[chunk] == 0) continue;
    const PlacedPoint* const from = points + static_cast<size_t>(chunk) * kChunk;
    const uint32_t here = Min(count - chunk * kChunk, kChunk);
    PlacedPoint mine[kEach];
#pragma unroll
    for (uint32_t e = 0; e < kEach; ++e) {
      const uint32_t i = e * kPointThreads + threadIdx.x;
      mine[e] = i < here ? LoadPoint(&from[i]) : PlacedPoint{};
    }
    // Load the next points while these are sorted.
    if (uint64_t{chunk} + gridDim.x < chunks) {
      const PlacedPoint* const next = from + static_cast<size_t>(gridDim.x) * kChunk;
      const uint32_t there = Min(count - (chunk + gridDim.x) * kChunk, kChunk);
#pragma unroll
      for (uint32_t e = 0; e < kEach; ++e) {
        const uint32_t i = e * kPointThreads + threadIdx.x;
        if (i < there) AskFor(&next[i]);
      }
    }
    ClearCounts<kEach>(regions);
    __syncthreads();
    SortChunk<kEach, kAll>(sort, chunk, regions, mine);
    __syncthreads();
  }
}

__global__ void __launch_bounds__(kPointThreads)
    SortFewPointsKernel(const __grid_constant__ FewPoints few) {
  const uint32_t regions = few.sort.within.drawn_count(), i = threadIdx.x;
  ClearCounts<1>(regions);
  PutFew(few.table, few.entries, few.entry_count);
  __syncthreads();
  PlacedPoint mine[1];
  if (i < few.count) {
    const uint32_t d = DrawableOf(few.list, i);
    mine[0] = MakePoint(few.table[few.list.slot(d)], i - static_cast<uint32_t>(few.list.first(d)),
                        few.sort.within);
    StorePoint(mine[0], &few.points[i]);
  }
  SortChunk<1, false>(few.sort, 0, regions, mine);
}

template <uint32_t kEach, bool kAll>
cudaError_t SortPointsBy(const PointSort& sort, const PlacedPoint* points, uint32_t count,
                         uint32_t multiprocessors, cudaStream_t stream) {
  const size_t shared = SortPointsShared(sort.within.drawn_count(), kEach);
  const cudaError_t error =
      cudaFuncSetAttribute(SortPointsKernel<kEach, kAll>,
                           cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(shared));
  if (error != cudaSuccess) return error;
  const uint64_t chunks = (uint64_t{count} + kPointThreads * kEach - 1) / (kPointThreads * kEach);
  const uint32_t blocks = static_cast<uint32_t>(Min<uint64_t>(chunks, multiprocessors));
  SortPointsKernel<kEach, kAll><<<blocks, kPointThreads, shared, stream>>>(sort, points, count);
  return cudaGetLastError();
}

// -------------------------------------------------------------------------------- regions and ends

__global__ void FindPointRegionsKernel(const PlacedPoint* points, uint32_t count,
                                       uint64_t* regions) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const PlacedPoint point = LoadPoint(&points[i]);
  if (point.word != 0) SetRegion(regions, point.region());
}

__global__ void MarkPointsKernel(ItemList list, uint32_t count, const PlacedPoint* points,
                                 uint8_t* dirty) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const PlacedPoint point = LoadPoint(&points[PlaceOf(list, i)]);
  if (point.word != 0) dirty[point.region()] = 1;
}

__global__ void KillPointsKernel(ItemList list, uint32_t count, PlacedPoint* points, uint32_t chunk,
                                 uint32_t* touched) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const uint64_t at = PlaceOf(list, i);
  points[at].word = 0;
  if (touched != nullptr) touched[at / chunk] = 1;
}

}  // namespace

cudaError_t MakePoints(const TableEntry* table, const ItemList& list, uint32_t items,
                       const RegionGrid& grid, PlacedPoint* points, cudaStream_t stream) {
  const uint32_t blocks =
      static_cast<uint32_t>((uint64_t{items} + kMadeByBlock - 1) / kMadeByBlock);
  MakePointsKernel<<<blocks, kMakeThreads, 0, stream>>>(table, list, items, grid, points);
  return cudaGetLastError();
}

cudaError_t CopyPoints(const ItemList& list, uint64_t first, uint32_t count,
                       const PlacedPoint* from, PlacedPoint* to, cudaStream_t stream) {
  CopyPointsKernel<<<Blocks(uint64_t{count}), kItemThreads, 0, stream>>>(list, first, count, from,
                                                                         to);
  return cudaGetLastError();
}

size_t SortPointsShared(uint32_t regions, uint32_t each) {
  return sizeof(PlacedPoint) * kPointThreads * each + size_t{regions} * sizeof(uint16_t);
}

cudaError_t CountPoints(const PlacedPoint* points, uint32_t count, const RegionGrid& within,
                        uint32_t* found, cudaStream_t stream) {
  CountPointsKernel<<<Blocks(uint64_t{count}), kItemThreads, 0, stream>>>(points, count, within,
                                                                          found);
  return cudaGetLastError();
}

cudaError_t SortPoints(const PointSort& sort, const PlacedPoint* points, uint32_t count,
                       uint32_t multiprocessors, cudaStream_t stream) {
  const bool all = sort.within.DrawsAll();
  switch (sort.each) {
    case 16:
      return (all ? SortPointsBy<16, true> : SortPointsBy<16, false>)(sort, points, count,
                                                                      multiprocessors, stream);
    case 4:
      return (all ? SortPointsBy<4, true> : SortPointsBy<4, false>)(sort, points, count,
                                                                    multiprocessors, stream);
    case 1:
      return (all ? SortPointsBy<1, true> : SortPointsBy<1, false>)(sort, points, count,
                                                                    multiprocessors, stream);
    default:
      return cudaErrorInvalidValue;
  }
}

cudaError_t SortFewPoints(const FewPoints& few, cudaStream_t stream) {
  const size_t shared = SortPointsShared(few.sort.within.drawn_count(), 1);
  const cudaError_t error = cudaFuncSetAttribute(
      SortFewPointsKernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(shared));
  if (error != cudaSuccess) return error;
  SortFewPointsKernel<<<1, kPointThreads, shared, stream>>>(few);
  return cudaGetLastError();
}

cudaError_t FindPointRegions(const PlacedPoint* points, uint32_t count, uint64_t* regions,
                             cudaStream_t stream) {
  FindPointRegionsKernel<<<Blocks(uint64_t{count}), kItemThreads, 0, stream>>>(points, count,
                                                                               regions);
  return cudaGetLastError();
}

cudaError_t MarkPoints(const ItemList& list, uint32_t count, const PlacedPoint* points,
                       uint8_t* dirty, cudaStream_t stream) {
  MarkPointsKernel<<<Blocks(uint64_t{count}), kItemThreads, 0, stream>>>(list, count, points,
                                                                         dirty);
  return cudaGetLastError();
}

cudaError_t KillPoints(const ItemList& list, uint32_t count, PlacedPoint* points, uint32_t chunk,
                       uint32_t* touched, cudaStream_t stream) {
  KillPointsKernel<<<Blocks(uint64_t{count}), kItemThreads, 0, stream>>>(list, count, points, chunk,
                                                                         touched);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
