// Draws an implicit shape in a tile, by a block of threads. Usually the voxels that it covers are
// already known (kernels_implicit.cu). If there was no memory for them, they are found here: P's
// hoisted values along each axis (hoisted.h); which parts of 4³ voxels may have something, by
// intervals; P in these parts and around them, four voxels per thread; then, by the definition
// (implicit/field.h), which voxels have a neighbour on the other side or lie within the shell.
//
// Loops around the program's execution are the same for all threads of a warp: idle threads execute
// it as well and ignore the results.
#pragma once

#include "gpu/cuda/covered_types.h"
#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/cuda/warp-inl.h"
#include "gpu/implicit/field.h"
#include "gpu/implicit/row.h"
#include "gpu/primitives/implicit.h"

namespace voxeld::gpu::cuda {

struct ImplicitScratch {
  static constexpr int32_t kPart = 4;
  static constexpr int32_t kParts = kTileSize / kPart;
  static constexpr uint32_t kAllParts = kParts * kParts * kParts;
  static constexpr int32_t kRows = kTileSize + 2;

  // P's hoisted values: at voxels from one before the box on, for a shell with gradients; and in
  // parts.
  float value[implicit::kMostHoisted][kRows + 2];
  float gradient[implicit::kMostHoisted][kRows][3];
  implicit::Interval range[implicit::kMostHoisted][kParts];
  // P in rows [z][y] from one before the box on, in parts with anything and their neighbours.
  static constexpr int32_t kQuads = (kRows + 3) / 4;
  alignas(16) implicit::Quad p[kRows][kRows][kQuads];
  uint8_t row_parts[kParts][kParts];  // [z][y], bits: parts along x with anything
  uint16_t near[kTileVoxels];         // voxels that may lie in the shell: place in 16³, x fastest
  uint32_t near_count;
  uint32_t some;  // parts with anything: their numbers,
  uint8_t list[kAllParts];
  implicit::BoxState parts[kAllParts];  // and what is known of each
};

// A tile's box, and how to compute P in it.
struct ImplicitTile {
  const implicit::Field& field;
  const Solid& solid;
  ImplicitScratch& scratch;
  Box3 box;
  float reach;  // for a shell: Field::ReachIn of the box

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

// Each thread handles a place along an axis, or a part along an axis; these are in different warps.
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

// Returns P at four voxels along x, from the place of the first in the tile, from −1 on.
static __device__ __noinline__ implicit::Quad ImplicitValues(const ImplicitTile& tile, int32_t x,
                                                             int32_t y, int32_t z) {
  implicit::Quad q[3];
  const implicit::Field& field = tile.field;
  if (field.hoisted().needs_coordinates()) {
    const implicit::Quad dx = implicit::EachOf<4>([&](size_t i) {
      return tile.solid.Distance(0, int64_t{tile.box.lo[0]} + x + static_cast<int32_t>(i));
    });
    const implicit::Quad dy = implicit::ConstantLike(
                             dx, tile.solid.Distance(1, int64_t{tile.box.lo[1]} + y)),
                         dz = implicit::ConstantLike(
                             dx, tile.solid.Distance(2, int64_t{tile.box.lo[2]} + z));
    field.Coordinates(dx, dy, dz, q);
  }
  return field.Rest(q, [&](uint32_t v) {
    const int axis = field.hoisted().axis_of(v);
    const float* const along = tile.scratch.value[v];
    if (axis == 0) {
      return implicit::EachOf<4>([&](size_t i) { return along[x + 1 + static_cast<int32_t>(i)]; });
    }
    return implicit::ConstantLike(implicit::Quad(), along[(axis == 1 ? y : z) + 1]);
  });
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
// Returns the word of a voxel of the volume.
static __device__ __noinline__ uint32_t ImplicitColor(const implicit::Field& field,
                                                      uint32_t priority, bool erase, int32_t x,
                                                      int32_t y, int32_t z) {
  float q[3] = {};
  if (!field.is_uniform()) field.CoordinatesOf(x, y, z, q);
  return MakeWord(priority, erase, field.ColorAt(q));
}
// The same if the voxel is within the shape's bound; otherwise 0.
static __device__ __noinline__ uint32_t ImplicitWord(const implicit::Field& field,
                                                     uint32_t priority, bool erase, int32_t x,
                                                     int32_t y, int32_t z) {
  if (field.is_bounded()) {
    float q[3];
    field.CoordinatesOf(x, y, z, q);
    if (!field.IsBounded(q)) return 0;
  }
  return ImplicitColor(field, priority, erase, x, y, z);
}

// Finds which parts have anything; returns false if none has. Called by the whole block.
__device__ inline bool FindImplicitParts(const ImplicitTile& tile) {
  ImplicitScratch& s = tile.scratch;
  FindHoisted(tile);
  if (threadIdx.x == 0) s.some = s.near_count = 0;
  __syncthreads();
  if (threadIdx.x < ImplicitScratch::kAllParts) {
    const uint32_t part = threadIdx.x;
    int32_t at[3];
    ImplicitTile::PartAt(part, at);
    const implicit::BoxState state = ImplicitState(tile, part);
    s.parts[part] = state;
    bool here = true;
    for (int a = 0; a < 3; ++a) here = here && tile.box.lo[a] + at[a] < tile.box.hi[a];
    const bool some = here && !state.none;
    if (some) s.list[atomicAdd(&s.some, 1u)] = static_cast<uint8_t>(part);
    const uint32_t bits = __ballot_sync(kAllLanes, some && !state.all);
    if (part % 4 == 0) {
      s.row_parts[part / 16][part / 4 % 4] = static_cast<uint8_t>(bits >> part % 32 & 0xFu);
    }
  }
  __syncthreads();
  const bool any = s.some != 0;
  __syncthreads();  // all threads have read it
  return any;
}

// Computes P in the parts that matter. Called by the whole block.
__device__ inline void FindImplicitValues(const ImplicitTile& tile) {
  constexpr int32_t kRows = ImplicitScratch::kRows, kQuads = ImplicitScratch::kQuads;
  constexpr int32_t kAll = kRows * kRows * kQuads;
  ImplicitScratch& s = tile.scratch;
  const int32_t rim = tile.field.rim();
  const auto part = [](int32_t at) { return Clamp(at, 0, kTileSize - 1) / ImplicitScratch::kPart; };
  for (int32_t first = 0; first < kAll; first += static_cast<int32_t>(kDrawThreads)) {
    const int32_t i = first + static_cast<int32_t>(threadIdx.x);
    const int32_t x = i % kQuads * 4 - 1, y = i / kQuads % kRows - 1, z = i / kQuads / kRows - 1;
    bool wanted = false;
    if (i < kAll) {
      uint32_t bits = 0;
      for (int32_t k = part(z - rim); k <= part(z + rim); ++k) {
        for (int32_t j = part(y - rim); j <= part(y + rim); ++j) bits |= s.row_parts[k][j];
      }
      const int32_t lo = part(x - rim), hi = part(x + 3 + rim);
      wanted = (bits >> lo & ((2u << (hi - lo)) - 1u)) != 0;
    }
    if (__any_sync(kAllLanes, wanted) == 0) continue;
    const implicit::Quad p = ImplicitValues(tile, wanted ? x : 0, wanted ? y : 0, wanted ? z : 0);
    if (wanted) s.p[z + 1][y + 1][(x + 1) / 4] = p;
  }
}

// Returns whether the voxel at (x, y, z) of its tile has a neighbour on the other side whose |P| is
// not less.
__device__ inline bool IsBetweenSides(const ImplicitTile& tile, int32_t x, int32_t y, int32_t z) {
  const auto value = [&](int32_t dx, int32_t dy, int32_t dz) {
    return (&tile.scratch.p[z + dz + 1][y + dy + 1][0].at[0])[x + dx + 1];
  };
  const float p = value(0, 0, 0);
  const bool inside = implicit::Field::IsInside(p);
  const float magnitude = implicit::Field::Magnitude(p);
  const auto meets = [&](int32_t dx, int32_t dy, int32_t dz) {
    const float other = value(dx, dy, dz);
    return implicit::Field::IsInside(other) != inside &&
           magnitude <= implicit::Field::Magnitude(other);
  };
  if (!tile.field.cover()) {
    return meets(-1, 0, 0) || meets(1, 0, 0) || meets(0, -1, 0) || meets(0, 1, 0) ||
           meets(0, 0, -1) || meets(0, 0, 1);
  }
  bool any = false;
  for (int32_t n = 0; n < 27 && !any; ++n) any = meets(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
  return any;
}

// Raises a voxel that P selects.
__device__ inline void RaiseImplicit(const TableEntry& entry, const ImplicitTile& tile, int32_t x,
                                     int32_t y, int32_t z, uint32_t* words) {
  const int32_t at[3] = {tile.box.lo[0] + x, tile.box.lo[1] + y, tile.box.lo[2] + z};
  const uint32_t word =
      ImplicitWord(tile.field, entry.priority, entry.erase != 0, at[0], at[1], at[2]);
  if (word != 0) atomicMax(&words[IndexInRegion(at[0], at[1], at[2])], word);
}

// Draws the voxels of a part that are covered because of their neighbours' sides; lists those that
// may lie in the shell. Called by a warp.
__device__ inline void DrawImplicitPart(const TableEntry& entry, const ImplicitTile& tile,
                                        uint32_t part, uint32_t* words) {
  ImplicitScratch& s = tile.scratch;
  const implicit::BoxState state = s.parts[part];
  const implicit::Field& field = tile.field;
  const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
  int32_t at[3];
  ImplicitTile::PartAt(part, at);
  for (int32_t half = 0; half < 2; ++half) {
    const int32_t x = at[0] + lane % 4, y = at[1] + lane / 4 % 4, z = at[2] + lane / 16 + half * 2;
    const bool here = tile.box.lo[0] + x < tile.box.hi[0] && tile.box.lo[1] + y < tile.box.hi[1] &&
                      tile.box.lo[2] + z < tile.box.hi[2];
    bool covered = state.all, near = false;
    if (!state.all) {
      const float p = (&s.p[z + 1][y + 1][0].at[0])[x + 1];
      covered = field.solid() ? implicit::Field::IsInside(p) : field.half() == 0 && p == 0;
      if (!field.solid() && !covered && state.side == implicit::Side::kMixed) {
        covered = IsBetweenSides(tile, x, y, z);
      }
      near = tile.is_shell() && !covered && implicit::Abs(p) <= tile.reach;
    }
    const uint32_t nears = __ballot_sync(kAllLanes, near && here);
    uint32_t place = 0;
    if (lane == 0 && nears != 0)
      place = atomicAdd(&s.near_count, static_cast<uint32_t>(__popc(nears)));
    place = __shfl_sync(kAllLanes, place, 0);
    if (near && here) {
      s.near[place + static_cast<uint32_t>(__popc(nears & ((1u << lane) - 1u)))] =
          static_cast<uint16_t>(z << 8 | y << 4 | x);
    }
    if (covered && here) RaiseImplicit(entry, tile, x, y, z, words);
  }
}

// Draws an item's voxels, which lie in the tile of `box`. Called by the whole block.
static __device__ __noinline__ void DrawImplicit(const TableEntry& entry, uint32_t item,
                                                 const Box3& box, uint32_t* words,
                                                 ImplicitScratch& s) {
  const implicit::Field field(entry.source);
  const Box3 part = Intersect(box, entry.source.solid.bounds);
  if (IsEmpty(part)) return;  // the same for every thread, as is the code below
  const float* const known = entry.source.implicit.reach;
  const float reach = known != nullptr ? known[item] : Implicit::ReachOf(field, part);
  if (reach == Implicit::kNothing) return;
  const ImplicitTile tile{field, entry.source.solid, s, part, reach};
  if (!FindImplicitParts(tile)) return;
  FindImplicitValues(tile);
  __syncthreads();
  for (uint32_t i = threadIdx.x / 32; i < s.some; i += kDrawWarps) {
    DrawImplicitPart(entry, tile, s.list[i], words);
  }
  __syncthreads();
  const uint32_t count = s.near_count;
  for (uint32_t first = 0; first < count; first += kDrawThreads) {
    const uint32_t i = first + threadIdx.x;
    if (__any_sync(kAllLanes, i < count) == 0) continue;
    const uint32_t at = i < count ? s.near[i] : 0;
    const int32_t x = static_cast<int32_t>(at & 15), y = static_cast<int32_t>(at >> 4 & 15),
                  z = static_cast<int32_t>(at >> 8);
    const bool within = ImplicitIsWithin(tile, x, y, z);
    if (i < count && within) RaiseImplicit(entry, tile, x, y, z, words);
  }
  __syncthreads();
}

// Returns row (y, z) of the tile at (i, j, k), within the shape's bounds; bit x is voxel x of the
// tile.
__device__ inline uint32_t CoveredRow(const Source& source, int32_t i, int32_t j, int32_t k,
                                      uint32_t row) {
  const ImplicitPlace& place = source.implicit;
  const int32_t at[3] = {i - place.first[0], j - place.first[1], k - place.first[2]};
  uint32_t item = 0;
  for (int a = 2; a >= 0; --a) {
    if (at[a] < 0 || at[a] >= place.blocks[a]) return 0;
    item = item * static_cast<uint32_t>(place.blocks[a]) + static_cast<uint32_t>(at[a]);
  }
  // An item with nothing in it has no rows.
  if (__ldg(&place.reach[item]) == Implicit::kNothing) return 0;
  return __ldg(&place.rows[size_t{item} * kCoveredRows + row]);
}

// The same if the shape's rows are known, in a whole region, `box`: a thread looks up a row, a warp
// raises a plane.
static __device__ __noinline__ void DrawCovered(const TableEntry& entry, const Box3& box) {
  static_assert(RegionBits(0) == 5 && RegionBits(1) == 5 && kDrawWarps == 1u << RegionBits(2));
  const Source& source = entry.source;
  if (IsEmpty(Intersect(box, source.solid.bounds))) return;  // the same for every thread
  const uint32_t lane = threadIdx.x % 32, plane = threadIdx.x / 32;
  const int32_t i = box.lo[0] / kTileSize,
                j = box.lo[1] / kTileSize + static_cast<int32_t>(lane / 16),
                k = box.lo[2] / kTileSize;
  const uint32_t in_tile = plane << 4 | lane % 16;
  const uint32_t row =
      CoveredRow(source, i, j, k, in_tile) | CoveredRow(source, i + 1, j, k, in_tile) << 16;
  const implicit::Field field(source);
  const bool uniform = field.is_uniform();
  uint32_t word = MakeWord(entry.priority, entry.erase != 0, source.UniformColor());
  uint32_t* const at = SharedRegion().words + (plane << 10 | lane);
  for (uint32_t left = __ballot_sync(kAllLanes, row != 0); left != 0; left &= left - 1) {
    const uint32_t r = static_cast<uint32_t>(__ffs(static_cast<int>(left))) - 1;
    if ((__shfl_sync(kAllLanes, row, r) >> lane & 1) == 0) continue;
    if (!uniform) {
      word = ImplicitColor(
          field, entry.priority, entry.erase != 0, box.lo[0] + static_cast<int32_t>(lane),
          box.lo[1] + static_cast<int32_t>(r), box.lo[2] + static_cast<int32_t>(plane));
    }
    at[r << 5] = Max(at[r << 5], word);  // no other thread accesses this voxel now
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
