// An implicit shape in a tile, by a block of threads: which parts of 4³ voxels may have something, by
// intervals; then what is inside, a bit each, with a rim around the tile; then whoever has a neighbour
// on the other side, or lies within the shell, by the definition (implicit/field.h).
//
// Loops around the program's run are the same for all threads of a warp: idle ones run it as well, and
// take no notice of what comes out.
#pragma once

#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/cuda/warp-inl.h"
#include "gpu/implicit/field.h"
#include "gpu/primitives/implicit.h"

namespace voxeld::gpu::cuda {

struct ImplicitScratch {
  static constexpr int32_t kPart = 4;
  static constexpr int32_t kParts = kTileSize / kPart;
  static constexpr uint32_t kAllParts = kParts * kParts * kParts;
  static constexpr int32_t kRows = kTileSize + 2;

  uint32_t inside[kRows][kRows];  // [z][y], bit i for x = i − 1
  uint32_t within[kTileSize]
                 [kTileSize];  // |P| is small enough for the shell, for all that is known
  implicit::BoxState parts[kAllParts];
  uint32_t some, full;  // parts with anything; all of whose voxels are covered
  uint32_t list[kAllParts];
};

__device__ inline void ImplicitPartAt(uint32_t part, int32_t at[3]) {
  constexpr uint32_t kParts = ImplicitScratch::kParts;
  at[0] = static_cast<int32_t>(part % kParts) * ImplicitScratch::kPart;
  at[1] = static_cast<int32_t>(part / kParts % kParts) * ImplicitScratch::kPart;
  at[2] = static_cast<int32_t>(part / kParts / kParts) * ImplicitScratch::kPart;
}

// P at voxel (x, y, z).
static __device__ __noinline__ float ImplicitValue(const implicit::Field& field, int32_t x,
                                                   int32_t y, int32_t z) {
  float q[3];
  field.CoordinatesOf(x, y, z, q);
  return field.Surface(q);
}
static __device__ __noinline__ bool ImplicitIsWithin(const implicit::Field& field, int32_t x,
                                                     int32_t y, int32_t z) {
  float q[3];
  field.CoordinatesOf(x, y, z, q);
  implicit::Dual<float> dual[3];
  field.WithGradients(q, dual);
  return field.IsWithin(field.Surface(dual));
}
static __device__ __noinline__ implicit::BoxState ImplicitState(const implicit::Field& field,
                                                                const Box3& box) {
  return field.StateOf(box);
}
// If it is bounded, the voxel's word; else 0.
static __device__ __noinline__ uint32_t ImplicitWord(const implicit::Field& field,
                                                     uint32_t priority, bool erase, int32_t x,
                                                     int32_t y, int32_t z) {
  float q[3];
  field.CoordinatesOf(x, y, z, q);
  if (!field.IsBounded(q)) return 0;
  return MakeWord(priority, erase, field.ColorAt(q));
}

// Finds out which parts of `box` have anything; false if none has.
__device__ inline bool FindImplicitParts(const implicit::Field& field, const Box3& box,
                                         ImplicitScratch& s) {
  if (threadIdx.x == 0) s.some = s.full = 0;
  __syncthreads();
  if (threadIdx.x < ImplicitScratch::kAllParts) {
    const uint32_t part = threadIdx.x;
    int32_t at[3];
    ImplicitPartAt(part, at);
    Box3 voxels;
    for (int a = 0; a < 3; ++a) {
      voxels.lo[a] = box.lo[a] + at[a];
      voxels.hi[a] = Min(voxels.lo[a] + ImplicitScratch::kPart, box.hi[a]);
    }
    const bool empty = IsEmpty(voxels);
    if (empty) voxels = box;
    const implicit::BoxState state = ImplicitState(field, voxels);
    s.parts[part] = state;
    if (!empty && !state.none) s.list[atomicAdd(&s.some, 1u)] = part;
  }
  for (uint32_t i = threadIdx.x; i < ImplicitScratch::kRows * ImplicitScratch::kRows;
       i += kDrawThreads) {
    (&s.inside[0][0])[i] = 0;
  }
  for (uint32_t i = threadIdx.x; i < kTileSize * kTileSize; i += kDrawThreads) {
    (&s.within[0][0])[i] = 0;
  }
  __syncthreads();
  return s.some != 0;
}

// Which voxels of the part, and around it if `rim`, are inside. A warp's.
__device__ inline void FindImplicitSides(const implicit::Field& field, const Box3& box,
                                         uint32_t part, ImplicitScratch& s) {
  const int32_t rim = field.solid() ? 0 : 1;
  const implicit::BoxState state = s.parts[part];
  int32_t at[3];
  ImplicitPartAt(part, at);
  // What neighbouring parts that have something find themselves is left to them.
  int32_t lo[3], n[3];
  for (int a = 0; a < 3; ++a) {
    lo[a] = at[a] - rim;
    n[a] = ImplicitScratch::kPart + 2 * rim;
  }
  const int32_t count = n[0] * n[1] * n[2];
  for (int32_t first = 0; first < count; first += 32) {
    const int32_t i = first + static_cast<int32_t>(threadIdx.x % 32);
    const int32_t x = lo[0] + i % n[0], y = lo[1] + i / n[0] % n[1], z = lo[2] + i / n[0] / n[1];
    const bool mine = i < count;
    const bool own = x >= at[0] && x < at[0] + ImplicitScratch::kPart && y >= at[1] &&
                     y < at[1] + ImplicitScratch::kPart && z >= at[2] &&
                     z < at[2] + ImplicitScratch::kPart;
    const float p = ImplicitValue(field, box.lo[0] + x, box.lo[1] + y, box.lo[2] + z);
    if (!mine) continue;
    if (implicit::Field::IsInside(p)) {
      atomicOr(&s.inside[z + 1][y + 1], 1u << (x + 1));
    }
    if (own && !field.solid() && (field.half() == 0 ? p == 0 : implicit::Abs(p) <= state.reach)) {
      atomicOr(&s.within[z][y], 1u << x);
    }
  }
}

// Whether the voxel, at (x, y, z) in its tile, has a neighbour on the other side whose |P| is not less.
// By a warp, of which those with `asked` want to know.
__device__ inline bool IsBetweenSides(const implicit::Field& field, const Box3& box,
                                      const ImplicitScratch& s, int32_t x, int32_t y, int32_t z,
                                      bool asked) {
  const bool cover = field.cover();
  const auto inside = [&](int32_t dx, int32_t dy, int32_t dz) {
    return (s.inside[z + dz + 1][y + dy + 1] >> (x + dx + 1) & 1) != 0;
  };
  const bool own = asked && inside(0, 0, 0);
  bool any = false;
  float magnitude = 0;
  bool known = false;  // of the whole warp
  for (int32_t n = 0; n < 27; ++n) {
    const int32_t dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
    const int32_t steps = Abs(dx) + Abs(dy) + Abs(dz);
    if (steps == 0 || (!cover && steps > 1)) continue;
    const bool wanted = asked && !any && inside(dx, dy, dz) != own;
    if (__any_sync(kAllLanes, wanted) == 0) continue;
    const int32_t at[3] = {box.lo[0] + x, box.lo[1] + y, box.lo[2] + z};
    if (!known) magnitude = implicit::Field::Magnitude(ImplicitValue(field, at[0], at[1], at[2]));
    known = true;
    const float other =
        implicit::Field::Magnitude(ImplicitValue(field, at[0] + dx, at[1] + dy, at[2] + dz));
    any = any || (wanted && magnitude <= other);
  }
  return any;
}

// The voxels of the tile's `box`, by the whole block.
static __device__ __noinline__ void DrawImplicit(const TableEntry& entry, const Box3& tile,
                                                 uint32_t* words, ImplicitScratch& s) {
  const Box3 box = Intersect(tile, entry.source.solid.bounds);
  if (IsEmpty(box)) return;  // the same for every thread
  const implicit::Field field(entry.source);
  if (!FindImplicitParts(field, box, s)) return;
  const uint32_t warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  for (uint32_t i = warp; i < s.some; i += kDrawWarps) {
    if (!s.parts[s.list[i]].all) FindImplicitSides(field, box, s.list[i], s);
  }
  __syncthreads();
  for (uint32_t i = warp; i < s.some; i += kDrawWarps) {
    const uint32_t part = s.list[i];
    const implicit::BoxState state = s.parts[part];
    int32_t at[3];
    ImplicitPartAt(part, at);
    for (uint32_t half = 0; half < 2; ++half) {
      const int32_t x = at[0] + static_cast<int32_t>(lane % 4),
                    y = at[1] + static_cast<int32_t>(lane / 4 % 4),
                    z = at[2] + static_cast<int32_t>(lane / 16 + half * 2);
      const int32_t voxel[3] = {box.lo[0] + x, box.lo[1] + y, box.lo[2] + z};
      const bool mine = voxel[0] < box.hi[0] && voxel[1] < box.hi[1] && voxel[2] < box.hi[2];
      bool covered = false;
      if (field.solid()) {
        covered = mine && (state.all || (s.inside[z + 1][y + 1] >> (x + 1) & 1) != 0);
      } else {
        const bool near = mine && (s.within[z][y] >> x & 1) != 0;
        covered = near && field.half() == 0;
        if (field.half() != 0 && __any_sync(kAllLanes, near) != 0) {
          covered = near && ImplicitIsWithin(field, voxel[0], voxel[1], voxel[2]);
        }
        const bool asked = mine && !covered && state.side == implicit::Side::kMixed;
        if (__any_sync(kAllLanes, asked) != 0) {
          covered = IsBetweenSides(field, box, s, x, y, z, asked) || covered;
        }
      }
      if (!covered) continue;
      const uint32_t word =
          ImplicitWord(field, entry.priority, entry.erase != 0, voxel[0], voxel[1], voxel[2]);
      if (word != 0) atomicMax(&words[IndexInRegion(voxel[0], voxel[1], voxel[2])], word);
    }
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
