// Makes small triangles from drawables' items, and sorts them by region.
#include <cub/block/block_scan.cuh>

#include "gpu/cuda/lines-inl.h"
#include "gpu/cuda/triangle_kernels.h"
#include "gpu/primitives/triangles.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = kItemThreads;

__global__ void FindExtentsKernel(const float* positions, const uint32_t* indices,
                                  uint32_t triangles, uint32_t* extents) {
  uint32_t greatest[3] = {};
  const uint64_t stride = static_cast<uint64_t>(gridDim.x) * blockDim.x;
  for (uint64_t i = Thread(); i < triangles; i += stride) {
    const float* corner[3];
    for (uint64_t c = 0; c < 3; ++c) {
      const uint64_t vertex = indices != nullptr ? indices[i * 3 + c] : i * 3 + c;
      corner[c] = positions + vertex * 3;
    }
    for (uint32_t a = 0; a < 3; ++a) {
      for (uint32_t c = 0; c < 3; ++c) {
        const float apart = fabsf(corner[c][a] - corner[c == 2 ? 0 : c + 1][a]);
        greatest[a] = Max(greatest[a], __float_as_uint(apart));
      }
    }
  }
  for (uint32_t a = 0; a < 3; ++a) {
    for (int lanes = 16; lanes > 0; lanes /= 2) {
      greatest[a] = Max(greatest[a], __shfl_xor_sync(~0u, greatest[a], lanes));
    }
    if (threadIdx.x % 32 == 0) atomicMax(&extents[a], greatest[a]);
  }
}

__device__ CompactTriangle Load(const CompactTriangle* triangle) {
  const uint4* const at = reinterpret_cast<const uint4*>(triangle);
  const uint4 a = at[0], b = at[1];
  return {{{a.x, a.y}, {a.z, a.w}, {b.x, b.y}}, b.z, b.w};
}

__device__ void Store(const CompactTriangle& t, CompactTriangle* to) {
  uint4* const at = reinterpret_cast<uint4*>(to);
  at[0] = make_uint4(t.corners[0][0], t.corners[0][1], t.corners[1][0], t.corners[1][1]);
  at[1] = make_uint4(t.corners[2][0], t.corners[2][1], t.word, t.flags);
}

__global__ void MakeTrianglesKernel(const TableEntry* table, ItemList list, uint32_t items,
                                    CompactTriangle* triangles, uint32_t* colors) {
  const uint64_t i = Thread();
  if (i >= items) return;
  const uint32_t d = DrawableOf(list, i);
  const TableEntry& entry = table[list.slot(d)];
  const Triangle t = Triangles::ItemOf(entry.source, static_cast<uint32_t>(i - list.first(d)));
  const bool erase = entry.erase != 0;
  const bool mixed = !erase && (t.color[0] != t.color[1] || t.color[1] != t.color[2]);
  Store(MakeCompact(t, MakeWord(entry.priority, erase, t.color[0]), mixed), &triangles[i]);
  if (colors == nullptr) return;
  for (uint32_t c = 0; c < 3; ++c) colors[i * 3 + c] = t.color[c];
}

__global__ void CopyTrianglesKernel(ItemList list, uint64_t first, uint32_t count,
                                    const CompactTriangle* from, const uint32_t* colors_from,
                                    CompactTriangle* to, uint32_t* colors_to) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const uint64_t at = PlaceOf(list, first + i);
  Store(Load(&from[at]), &to[first + i]);
  if (colors_to == nullptr || colors_from == nullptr) return;
  for (uint32_t c = 0; c < 3; ++c) colors_to[(first + i) * 3 + c] = colors_from[at * 3 + c];
}

// For this many regions or fewer, a closer test does not pay off.
constexpr int32_t kFewRegions = 8;

// Calls f(region) for each drawn region that the triangle may touch.
template <typename F>
__device__ void ForRegions(const CompactTriangle& t, const RegionGrid& grid, F&& f) {
  int32_t lo[3], hi[3], at[3], count = 1;
  for (int a = 0; a < 3; ++a) {
    const CompactAxis axis = CompactAxis::Of(t, a);
    lo[a] = Max(grid.drawn_lo[a] << kBlockBits, (axis.origin + axis.lo(t.flags)) >> RegionBits(a));
    hi[a] =
        Min(grid.drawn_hi[a] << kBlockBits, ((axis.origin + axis.hi() - 1) >> RegionBits(a)) + 1);
    if (lo[a] >= hi[a]) return;
    count *= hi[a] - lo[a];
  }
  const uint32_t color[3] = {};
  const Triangle wide = count > kFewRegions ? TriangleOf(t, color) : Triangle{};
  for (at[2] = lo[2]; at[2] < hi[2]; ++at[2]) {
    for (at[1] = lo[1]; at[1] < hi[1]; ++at[1]) {
      for (at[0] = lo[0]; at[0] < hi[0]; ++at[0]) {
        if (count > kFewRegions) {
          Box3 box;
          for (int a = 0; a < 3; ++a) {
            box.lo[a] = at[a] << RegionBits(a);
            box.hi[a] = (at[a] + 1) << RegionBits(a);
          }
          if (!MayMeet(wide, box)) continue;
        }
        f(grid.RegionAt(at));
      }
    }
  }
}

__global__ void CountTrianglesKernel(TriangleSort sort, const CompactTriangle* triangles,
                                     uint32_t count) {
  const uint64_t i = Thread();
  if (i >= count) return;
  ForRegions(Load(&triangles[i]), sort.grid,
             [&](uint32_t region) { atomicAdd(&sort.counts[region], 1u); });
}

__global__ void FillTrianglesKernel(TriangleSort sort, const CompactTriangle* triangles,
                                    uint32_t count) {
  const uint64_t i = Thread();
  if (i >= count) return;
  ForRegions(Load(&triangles[i]), sort.grid, [&](uint32_t region) {
    const uint32_t place = sort.begin[region] + atomicSub(&sort.counts[region], 1u) - 1;
    if (place < sort.capacity) sort.places[place] = static_cast<uint32_t>(i);
  });
}

constexpr uint32_t kScanThreads = 1024;
constexpr uint32_t kScanEach = 16;

// Runs in one block: even a large volume has few regions.
__global__ void __launch_bounds__(kScanThreads) SumRegionsKernel(TriangleSort sort) {
  using Scan = cub::BlockScan<uint32_t, kScanThreads>;
  __shared__ typename Scan::TempStorage scan;
  const uint32_t regions = sort.grid.count();  // in whole blocks: a multiple of kScanEach
  uint32_t before = 0;
  for (uint32_t base = 0; base < regions; base += kScanThreads * kScanEach) {
    const uint32_t first = base + threadIdx.x * kScanEach;
    uint32_t counts[kScanEach], total;
    for (uint32_t e = 0; e < kScanEach; e += 4) {
      const uint4 four = first < regions ? *reinterpret_cast<const uint4*>(&sort.counts[first + e])
                                         : make_uint4(0, 0, 0, 0);
      counts[e] = four.x, counts[e + 1] = four.y, counts[e + 2] = four.z, counts[e + 3] = four.w;
    }
    for (uint32_t e = 0; e < kScanEach && sort.dirty != nullptr; ++e) {
      if (counts[e] != 0) sort.dirty[first + e] = 1;
    }
    Scan(scan).ExclusiveSum(counts, counts, total);
    for (uint32_t e = 0; e < kScanEach && first < regions; e += 4) {
      *reinterpret_cast<uint4*>(&sort.begin[first + e]) =
          make_uint4(before + counts[e], before + counts[e + 1], before + counts[e + 2],
                     before + counts[e + 3]);
    }
    before += total;
    __syncthreads();
  }
  if (threadIdx.x == 0) sort.begin[regions] = before;
}
static_assert(kRegionsInBlock % kScanEach == 0);

__global__ void FindTriangleRegionsKernel(const CompactTriangle* triangles, uint32_t count,
                                          RegionGrid grid, uint64_t* regions) {
  const uint64_t i = Thread();
  if (i >= count) return;
  ForRegions(Load(&triangles[i]), grid, [&](uint32_t region) { SetRegion(regions, region); });
}

__global__ void MarkFilledKernel(const uint32_t* begin, uint32_t regions, uint8_t* dirty) {
  const uint64_t r = Thread();
  if (r < regions && begin[r] != begin[r + 1]) dirty[r] = 1;
}

__global__ void MarkTrianglesKernel(ItemList list, uint32_t count, const CompactTriangle* triangles,
                                    RegionGrid grid, uint8_t* dirty) {
  const uint64_t i = Thread();
  if (i >= count) return;
  ForRegions(Load(&triangles[PlaceOf(list, i)]), grid, [&](uint32_t region) { dirty[region] = 1; });
}

__global__ void KillTrianglesKernel(ItemList list, uint32_t count, CompactTriangle* triangles) {
  const uint64_t i = Thread();
  if (i < count) triangles[PlaceOf(list, i)].word = 0;
}

}  // namespace

cudaError_t FindExtents(const float* positions, const uint32_t* indices, uint32_t triangles,
                        uint32_t* extents, cudaStream_t stream) {
  FindExtentsKernel<<<Clamp(Blocks(triangles), 1u, 1024u), kThreads, 0, stream>>>(
      positions, indices, triangles, extents);
  return cudaGetLastError();
}

cudaError_t MakeTriangles(const TableEntry* table, const ItemList& list, uint32_t items,
                          CompactTriangle* triangles, uint32_t* colors, cudaStream_t stream) {
  MakeTrianglesKernel<<<Blocks(items), kThreads, 0, stream>>>(table, list, items, triangles,
                                                              colors);
  return cudaGetLastError();
}

cudaError_t CopyTriangles(const ItemList& list, uint64_t first, uint32_t count,
                          const CompactTriangle* from, const uint32_t* colors_from,
                          CompactTriangle* to, uint32_t* colors_to, cudaStream_t stream) {
  CopyTrianglesKernel<<<Blocks(count), kThreads, 0, stream>>>(list, first, count, from, colors_from,
                                                              to, colors_to);
  return cudaGetLastError();
}

cudaError_t CountTriangles(const TriangleSort& sort, const CompactTriangle* triangles,
                           uint32_t count, cudaStream_t stream) {
  CountTrianglesKernel<<<Blocks(count), kThreads, 0, stream>>>(sort, triangles, count);
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  SumRegionsKernel<<<1, kScanThreads, 0, stream>>>(sort);
  return cudaGetLastError();
}

cudaError_t FillTriangles(const TriangleSort& sort, const CompactTriangle* triangles,
                          uint32_t count, cudaStream_t stream) {
  FillTrianglesKernel<<<Blocks(count), kThreads, 0, stream>>>(sort, triangles, count);
  return cudaGetLastError();
}

cudaError_t FindTriangleRegions(const CompactTriangle* triangles, uint32_t count,
                                const RegionGrid& grid, uint64_t* regions, cudaStream_t stream) {
  FindTriangleRegionsKernel<<<Blocks(count), kThreads, 0, stream>>>(triangles, count, grid,
                                                                    regions);
  return cudaGetLastError();
}

cudaError_t MarkFilled(const uint32_t* begin, uint32_t regions, uint8_t* dirty,
                       cudaStream_t stream) {
  MarkFilledKernel<<<Blocks(regions), kThreads, 0, stream>>>(begin, regions, dirty);
  return cudaGetLastError();
}

cudaError_t MarkTriangles(const ItemList& list, uint32_t count, const CompactTriangle* triangles,
                          const RegionGrid& grid, uint8_t* dirty, cudaStream_t stream) {
  MarkTrianglesKernel<<<Blocks(count), kThreads, 0, stream>>>(list, count, triangles, grid, dirty);
  return cudaGetLastError();
}

cudaError_t KillTriangles(const ItemList& list, uint32_t count, CompactTriangle* triangles,
                          cudaStream_t stream) {
  KillTrianglesKernel<<<Blocks(count), kThreads, 0, stream>>>(list, count, triangles);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
