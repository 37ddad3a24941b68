// Raises small triangles into a region's words.
#pragma once

#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/compact_triangle.h"

namespace voxeld::gpu::cuda {

__device__ inline CompactTriangle LoadTriangle(const CompactTriangle* triangle) {
  const uint4* const at = reinterpret_cast<const uint4*>(triangle);
  const uint4 a = __ldg(at), b = __ldg(at + 1);
  return {{{a.x, a.y}, {a.z, a.w}, {b.x, b.y}}, b.z, b.w};
}

// The rare case is a separate function that loads everything again, so that the common case has
// more registers. x, y, z: the region's first voxel.
__device__ __noinline__ inline void RaiseMixed(const TriangleBatchView& batch, uint32_t triangle,
                                               int32_t x, int32_t y, int32_t z, int32_t place) {
  const CompactTriangle t = LoadTriangle(&batch.triangles[triangle]);
  const int32_t voxel[3] = {x + (place & 31) - CompactAxis::Of(t, 0).origin,
                            y + (place >> 5 & 31) - CompactAxis::Of(t, 1).origin,
                            z + (place >> 10) - CompactAxis::Of(t, 2).origin};
  const uint32_t rgb = CompactColorAt(t, batch.colors + static_cast<size_t>(triangle) * 3, voxel);
  atomicMax(&SharedRegion().words[place], Recolored(t.word, rgb));
}

__device__ __noinline__ inline void RaiseFlat(const TriangleBatchView& batch, uint32_t triangle,
                                              int32_t x, int32_t y, int32_t z) {
  const CompactTriangle t = LoadTriangle(&batch.triangles[triangle]);
  const Box3 box{{x, y, z},
                 {x + (1 << RegionBits(0)), y + (1 << RegionBits(1)), z + (1 << RegionBits(2))}};
  const bool mixed = (t.flags & CompactTriangle::kMixed) != 0;
  uint32_t color[3] = {};
  for (uint32_t i = 0; i < 3 && mixed; ++i) {
    color[i] = batch.colors[static_cast<size_t>(triangle) * 3 + i];
  }
  EmitCompactFlat(t, color, box, RaiseVoxel(mixed ? Recolored(t.word, 0) : t.word, mixed));
}

// Draws one row of a triangle's part in the region; at: the region's first voxel.
__device__ inline void DrawTriangleRow(const TriangleBatchView& batch, uint32_t triangle,
                                       int32_t row, const int32_t at[3]) {
  const CompactTriangle t = LoadTriangle(&batch.triangles[triangle]);
  if ((t.flags & CompactTriangle::kFlat) != 0) {
    return RaiseFlat(batch, triangle, at[0], at[1], at[2]);
  }
  const CompactPart part = CompactPart::Of(t, at);
  const bool mixed = (t.flags & CompactTriangle::kMixed) != 0;
  EmitCompactRow(t, part, row, [&](int32_t place) {
    if (mixed) return RaiseMixed(batch, triangle, at[0], at[1], at[2], place);
    atomicMax(&SharedRegion().words[place], t.word);
  });
}

// Draws a batch, by the whole block: teams of warps take some triangles each, and a team's lanes a
// row each of the triangles' parts in the region, so that all have similar work. b: the number of
// the batch in the view. Without lists (if not kListed) all triangles are tested, and most have no
// rows. Not inlined, because lines need the registers.
template <bool kListed>
__device__ __noinline__ inline void DrawTriangles(const DrawView& view, uint32_t b) {
  RegionScratch& scratch = SharedRegion();
  const TriangleBatchView& batch = view.triangles.batches[b];
  const uint32_t region = scratch.region;
  int32_t at[3];
  view.regions.RegionCoordinates(region, at);
  for (int a = 0; a < 3; ++a) at[a] <<= RegionBits(a);
  const bool listed = kListed || batch.begin != nullptr;
  const uint32_t begin = listed ? batch.begin[region] : 0;
  const uint32_t count = listed ? batch.begin[region + 1] - begin : batch.count;
  uint32_t team = 1;  // in warps
  while (team < kDrawWarps && team * count < kDrawWarps) team *= 2;
  const uint32_t teams = kDrawWarps / team;
  const uint32_t group = Min((count + teams - 1) / teams, 32u);
  const uint32_t warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  for (uint32_t first = warp / team * group; first < count; first += teams * group) {
    uint32_t triangle = 0, rows = 0;
    if (lane < Min(group, count - first)) {
      triangle = listed ? __ldg(&batch.places[begin + first + lane]) : first + lane;
      const CompactTriangle t = LoadTriangle(&batch.triangles[triangle]);
      const CompactPart part = CompactPart::Of(t, at);
      if (t.word != 0) rows = static_cast<uint32_t>(part.row_count());
      if (rows != 0 && warp % team == 0) {
        const bool mixed = (t.flags & CompactTriangle::kMixed) != 0;
        EmitCompactVertices(t, part, [&](int32_t place, int vertex) {
          atomicMax(&scratch.words[place],
                    mixed ? Recolored(t.word, batch.colors[static_cast<size_t>(triangle) * 3 +
                                                           static_cast<uint32_t>(vertex)])
                          : t.word);
        });
      }
    }
    const uint32_t until = SumBefore(rows) + rows;  // of this lane's triangle and those before
    const uint32_t total = __shfl_sync(kAllLanes, until, 31);
    for (uint32_t base = warp % team * 32; base < total; base += team * 32) {
      const uint32_t row = base + lane;
      uint32_t owner = 0;  // lanes whose rows all come before
#pragma unroll
      for (uint32_t step = 16; step > 0; step /= 2) {
        if (__shfl_sync(kAllLanes, until, owner + step - 1) <= row) owner += step;
      }
      const uint32_t before = __shfl_sync(kAllLanes, until - rows, owner);
      const uint32_t drawn = __shfl_sync(kAllLanes, triangle, owner);
      if (row < total) {
        DrawTriangleRow(batch, drawn, static_cast<int32_t>(row - before), at);
      }
      __syncwarp();
    }
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
