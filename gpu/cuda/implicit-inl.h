// An implicit shape in a tile, by a block of threads: P's hoisted values along each axis (hoist.h);
// which parts of 4³ voxels may have something, by intervals; then what is inside, a bit each, with a
// rim around the tile; then whoever has a neighbour on the other side, or lies within the shell, by the
// definition (implicit/field.h).
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

  // P's hoisted values: at voxels from one before the box on, with gradients of a shell; and in parts.
  float value[implicit::kMostHoisted][kRows];
  float gradient[implicit::kMostHoisted][kRows][3];
  implicit::Interval range[implicit::kMostHoisted][kParts];
  uint32_t inside[kRows][kRows];  // [z][y], bit i for x = i − 1
  uint32_t within[kTileSize]
                 [kTileSize];  // |P| is small enough for the shell, for all that is known
  uint32_t some;               // parts with anything: their numbers,
  uint8_t list[kAllParts];
  implicit::BoxState parts[kAllParts];  // and what is known of each
};

// A tile's box, and how to compute P in it.
struct ImplicitTile {
  const implicit::Field& field;
  const Solid& solid;
  ImplicitScratch& scratch;
  Box3 box;
  float reach;  // of a shell: Field::ReachIn the box

  __device__ static void PartAt(uint32_t part, int32_t at[3]) {
    constexpr uint32_t kParts = ImplicitScratch::kParts;
    at[0] = static_cast<int32_t>(part % kParts) * ImplicitScratch::kPart;
    at[1] = static_cast<int32_t>(part / kParts % kParts) * ImplicitScratch::kPart;
    at[2] = static_cast<int32_t>(part / kParts / kParts) * ImplicitScratch::kPart;
  }
  __device__ bool is_shell() const { return !field.solid() && field.half() != 0; }
  __device__ uint32_t PlaceOf(uint32_t value, int32_t x, int32_t y, int32_t z) const {
    const int axis = field.hoisted().axis_of(value);
    return static_cast<uint32_t>((axis == 0 ? x : axis == 1 ? y : z) + 1);
  }
};

// Thread by thread: places along axes, then parts along axes, in warps of their own.
static __device__ __noinline__ void FindHoisted(const ImplicitTile& tile) {
  constexpr uint32_t kRows = ImplicitScratch::kRows, kParts = ImplicitScratch::kParts;
  ImplicitScratch& s = tile.scratch;
  const implicit::Field& field = tile.field;
  if (threadIdx.x < 3 * kRows) {
    const int axis = static_cast<int>(threadIdx.x / kRows);
    const uint32_t i = threadIdx.x % kRows;
    const float d =
        tile.solid.Distance(axis, int64_t{tile.box.lo[axis]} - 1 + static_cast<int32_t>(i));
    if (tile.is_shell()) {
      field.DualHoistedAlong(axis, d, [&](const implicit::Dual<float>& value, uint32_t v) {
        s.value[v][i] = value.value;
        for (int a = 0; a < 3; ++a) s.gradient[v][i][a] = value.d[a];
      });
    } else {
      field.HoistedAlong(axis, d, [&](float value, uint32_t v) { s.value[v][i] = value; });
    }
  } else if (threadIdx.x >= 64 && threadIdx.x < 64 + 3 * kParts) {
    const int axis = static_cast<int>((threadIdx.x - 64) / kParts);
    const uint32_t i = (threadIdx.x - 64) % kParts;
    const int64_t lo = int64_t{tile.box.lo[axis]} + i * ImplicitScratch::kPart;
    const int64_t last = Min<int64_t>(lo + ImplicitScratch::kPart, tile.box.hi[axis]) - 1;
    const implicit::Interval d = {tile.solid.Distance(axis, lo - field.rim()),
                                  tile.solid.Distance(axis, Max<int64_t>(lo, last) + field.rim()),
                                  false};
    field.HoistedAlong(axis, d,
                       [&](const implicit::Interval& value, uint32_t v) { s.range[v][i] = value; });
  }
}

// P at a voxel, by its place in the tile, from −1 on.
static __device__ __noinline__ float ImplicitValue(const ImplicitTile& tile, int32_t x, int32_t y,
                                                   int32_t z) {
  float q[3];
  if (tile.field.hoisted().needs_coordinates()) {
    tile.field.CoordinatesOf(tile.box.lo[0] + x, tile.box.lo[1] + y, tile.box.lo[2] + z, q);
  }
  return tile.field.Rest(
      q, [&](uint32_t v) { return tile.scratch.value[v][tile.PlaceOf(v, x, y, z)]; });
}
static __device__ __noinline__ bool ImplicitIsWithin(const ImplicitTile& tile, int32_t x, int32_t y,
                                                     int32_t z) {
  implicit::Dual<float> dual[3];
  if (tile.field.hoisted().needs_coordinates()) {
    float q[3];
    tile.field.CoordinatesOf(tile.box.lo[0] + x, tile.box.lo[1] + y, tile.box.lo[2] + z, q);
    tile.field.WithGradients(q, dual);
  }
  return tile.field.IsWithin(tile.field.Rest(dual, [&](uint32_t v) {
    const uint32_t place = tile.PlaceOf(v, x, y, z);
    const float* const d = tile.scratch.gradient[v][place];
    return implicit::Dual<float>{tile.scratch.value[v][place], {d[0], d[1], d[2]}};
  }));
}
static __device__ __noinline__ implicit::BoxState ImplicitState(const ImplicitTile& tile,
                                                                uint32_t part) {
  constexpr int32_t kPart = ImplicitScratch::kPart;
  const implicit::Field& field = tile.field;
  int32_t at[3];
  ImplicitTile::PartAt(part, at);
  implicit::Interval q[3];
  if (field.hoisted().needs_coordinates()) {
    implicit::Interval d[3];
    for (int a = 0; a < 3; ++a) {
      const int64_t lo = int64_t{tile.box.lo[a]} + at[a];
      const int64_t last = Max<int64_t>(lo, Min<int64_t>(lo + kPart, tile.box.hi[a]) - 1);
      d[a] = {tile.solid.Distance(a, lo - field.rim()), tile.solid.Distance(a, last + field.rim()),
              false};
    }
    field.Coordinates(d[0], d[1], d[2], q);
  }
  const implicit::Interval p = field.Rest(
      q, [&](uint32_t v) { return tile.scratch.range[v][at[field.hoisted().axis_of(v)] / kPart]; });
  implicit::BoxState state = field.StateOf(p);
  if (tile.is_shell()) state.none = state.none && implicit::Abs(p).lo > tile.reach;
  return state;
}
// If it is bounded, the word of a voxel of the volume; else 0.
static __device__ __noinline__ uint32_t ImplicitWord(const implicit::Field& field,
                                                     uint32_t priority, bool erase, int32_t x,
                                                     int32_t y, int32_t z) {
  float q[3] = {};
  if (!field.is_plain()) field.CoordinatesOf(x, y, z, q);
  if (!field.IsBounded(q)) return 0;
  return MakeWord(priority, erase, field.ColorAt(q));
}

// Finds out which parts have anything; false if none has. By the whole block.
__device__ inline bool FindImplicitParts(const ImplicitTile& tile) {
  ImplicitScratch& s = tile.scratch;
  FindHoisted(tile);
  if (threadIdx.x == 0) s.some = 0;
  for (uint32_t i = threadIdx.x; i < ImplicitScratch::kRows * ImplicitScratch::kRows;
       i += kDrawThreads) {
    (&s.inside[0][0])[i] = 0;
  }
  for (uint32_t i = threadIdx.x; i < kTileSize * kTileSize; i += kDrawThreads) {
    (&s.within[0][0])[i] = 0;
  }
  __syncthreads();
  if (threadIdx.x < ImplicitScratch::kAllParts) {
    const uint32_t part = threadIdx.x;
    int32_t at[3];
    ImplicitTile::PartAt(part, at);
    const implicit::BoxState state = ImplicitState(tile, part);
    s.parts[part] = state;
    bool here = true;
    for (int a = 0; a < 3; ++a) here = here && tile.box.lo[a] + at[a] < tile.box.hi[a];
    if (here && !state.none) s.list[atomicAdd(&s.some, 1u)] = static_cast<uint8_t>(part);
  }
  __syncthreads();
  const bool any = s.some != 0;
  __syncthreads();  // all have seen it
  return any;
}

// A voxel's side, and of a shell whether it may lie in it. By a warp, of which those with `asked`.
__device__ inline void FindImplicitSide(const ImplicitTile& tile, int32_t x, int32_t y, int32_t z,
                                        bool asked, bool own) {
  ImplicitScratch& s = tile.scratch;
  const implicit::Field& field = tile.field;
  const float p = ImplicitValue(tile, x, y, z);
  if (asked && implicit::Field::IsInside(p)) atomicOr(&s.inside[z + 1][y + 1], 1u << (x + 1));
  const bool near = field.half() == 0 ? p == 0 : implicit::Abs(p) <= tile.reach;
  if (asked && own && near && !field.solid()) atomicOr(&s.within[z][y], 1u << x);
}

// Which voxels of a part with anything are inside, and of those around it that lie in other tiles: of
// parts with nothing beside it all voxels are on the side of those next to them. A warp's.
__device__ inline void FindImplicitSides(const ImplicitTile& tile, uint32_t part) {
  constexpr int32_t kPart = ImplicitScratch::kPart;
  const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
  int32_t at[3];
  ImplicitTile::PartAt(part, at);
  for (int32_t half = 0; half < 2; ++half) {
    FindImplicitSide(tile, at[0] + lane % 4, at[1] + lane / 4 % 4, at[2] + lane / 16 + half * 2,
                     true, true);
  }
  if (tile.scratch.parts[part].side != implicit::Side::kMixed || tile.field.solid()) return;
  const bool cover = tile.field.cover();
  // Voxels of the next tile, and of the last one that is in the volume, are past the box.
  const int32_t end[3] = {tile.box.hi[0] - tile.box.lo[0], tile.box.hi[1] - tile.box.lo[1],
                          tile.box.hi[2] - tile.box.lo[2]};
  const auto outer = [&](int a) { return at[a] == 0 || at[a] + kPart >= end[a]; };
  if (!outer(0) && !outer(1) && !outer(2)) return;
  constexpr int32_t kAround = kPart + 2;
  for (int32_t first = 0; first < kAround * kAround * kAround; first += 32) {
    const int32_t i = first + lane;
    const int32_t p[3] = {at[0] - 1 + i % kAround, at[1] - 1 + i / kAround % kAround,
                          at[2] - 1 + i / kAround / kAround};
    bool past = false;
    int32_t beyond = 0;  // the part, on how many axes
    for (int a = 0; a < 3; ++a) {
      past = past || p[a] < 0 || p[a] >= end[a];
      beyond += p[a] < at[a] || p[a] >= at[a] + kPart ? 1 : 0;
    }
    const bool asked = i < kAround * kAround * kAround && past && beyond > 0 &&
                       (cover || beyond == 1) && p[0] <= kTileSize && p[1] <= kTileSize &&
                       p[2] <= kTileSize;
    if (__any_sync(kAllLanes, asked) == 0) continue;
    FindImplicitSide(tile, asked ? p[0] : 0, asked ? p[1] : 0, asked ? p[2] : 0, asked, false);
  }
}

// The same of a part with nothing: all are on one side. It matters only to others in the tile.
__device__ inline void FillImplicitSide(const ImplicitTile& tile, uint32_t part) {
  constexpr int32_t kPart = ImplicitScratch::kPart;
  if (tile.scratch.parts[part].side != implicit::Side::kInside) return;
  int32_t at[3];
  ImplicitTile::PartAt(part, at);
  const uint32_t lane = threadIdx.x % 32;
  if (lane < kPart * kPart) {
    atomicOr(&tile.scratch.inside[at[2] + static_cast<int32_t>(lane / kPart) + 1]
                                 [at[1] + static_cast<int32_t>(lane % kPart) + 1],
             0xFu << (at[0] + 1));
  }
}

// Whether the voxel, at (x, y, z) in its tile, has a neighbour on the other side whose |P| is not less.
// By a warp, of which those with `asked` want to know.
__device__ inline bool IsBetweenSides(const ImplicitTile& tile, int32_t x, int32_t y, int32_t z,
                                      bool asked) {
  const ImplicitScratch& s = tile.scratch;
  const bool cover = tile.field.cover();
  const auto inside = [&](int32_t dx, int32_t dy, int32_t dz) {
    return (s.inside[z + dz + 1][y + dy + 1] >> (x + dx + 1) & 1) != 0;
  };
  const bool own = asked && inside(0, 0, 0);
  bool any = false, known = false;  // `known` is the whole warp's
  float magnitude = 0;
  for (int32_t n = 0; n < 27; ++n) {
    const int32_t dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
    const int32_t steps = Abs(dx) + Abs(dy) + Abs(dz);
    if (steps == 0 || (!cover && steps > 1)) continue;
    const bool wanted = asked && !any && inside(dx, dy, dz) != own;
    if (__any_sync(kAllLanes, wanted) == 0) continue;
    if (!known) magnitude = implicit::Field::Magnitude(ImplicitValue(tile, x, y, z));
    known = true;
    const float other = implicit::Field::Magnitude(ImplicitValue(tile, x + dx, y + dy, z + dz));
    any = any || (wanted && magnitude <= other);
  }
  return any;
}

// Whether the voxel is covered, but for bounds. By a warp, of which those with `asked` want to know.
__device__ inline bool IsImplicitCovered(const ImplicitTile& tile, const implicit::BoxState& state,
                                         int32_t x, int32_t y, int32_t z, bool asked) {
  const ImplicitScratch& s = tile.scratch;
  const implicit::Field& field = tile.field;
  if (field.solid()) {
    return asked && (state.all || (s.inside[z + 1][y + 1] >> (x + 1) & 1) != 0);
  }
  const bool near = asked && (s.within[z][y] >> x & 1) != 0;
  bool covered = near && field.half() == 0;
  if (field.half() != 0 && __any_sync(kAllLanes, near) != 0) {
    const bool within = ImplicitIsWithin(tile, x, y, z);
    covered = near && within;
  }
  const bool between = asked && !covered && state.side == implicit::Side::kMixed;
  if (__any_sync(kAllLanes, between) == 0) return covered;
  const bool is_between = IsBetweenSides(tile, x, y, z, between);
  return covered || is_between;
}

// An item's voxels, which lie in the tile of `box`, by the whole block.
static __device__ __noinline__ void DrawImplicit(const TableEntry& entry, uint32_t item,
                                                 const Box3& box, uint32_t* words,
                                                 ImplicitScratch& s) {
  const implicit::Field field(entry.source);
  const ImplicitTile tile{field, entry.source.solid, s, Intersect(box, entry.source.solid.bounds),
                          entry.source.implicit.reach[item]};
  if (IsEmpty(tile.box) || !FindImplicitParts(tile)) return;  // the same for every thread
  const uint32_t warp = threadIdx.x / 32;
  for (uint32_t part = warp; part < ImplicitScratch::kAllParts; part += kDrawWarps) {
    if (s.parts[part].none) FillImplicitSide(tile, part);
  }
  for (uint32_t i = warp; i < s.some; i += kDrawWarps) {
    if (!s.parts[s.list[i]].all) FindImplicitSides(tile, s.list[i]);
  }
  __syncthreads();
  for (uint32_t i = warp; i < s.some; i += kDrawWarps) {
    const implicit::BoxState state = s.parts[s.list[i]];
    int32_t at[3];
    ImplicitTile::PartAt(s.list[i], at);
    for (int32_t half = 0; half < 2; ++half) {
      const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
      const int32_t x = at[0] + lane % 4, y = at[1] + lane / 4 % 4,
                    z = at[2] + lane / 16 + half * 2;
      const int32_t voxel[3] = {tile.box.lo[0] + x, tile.box.lo[1] + y, tile.box.lo[2] + z};
      const bool here =
          voxel[0] < tile.box.hi[0] && voxel[1] < tile.box.hi[1] && voxel[2] < tile.box.hi[2];
      if (!IsImplicitCovered(tile, state, x, y, z, here)) continue;
      const uint32_t word =
          ImplicitWord(field, entry.priority, entry.erase != 0, voxel[0], voxel[1], voxel[2]);
      if (word != 0) atomicMax(&words[IndexInRegion(voxel[0], voxel[1], voxel[2])], word);
    }
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
