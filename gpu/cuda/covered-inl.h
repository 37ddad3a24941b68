// Computes which voxels an implicit shape covers (implicit/field.h), tile by tile, by blocks of
// threads: P at a tile's voxels and those around it, a thread for each row along x; then which side
// of the surface each voxel is on, which voxels have a neighbour on the other side, and which lie
// within the shell.
//
// P is computed by a Formula: interpreted (kernels_implicit.cu), or compiled at run time from the
// same program (implicit/formula_text.h), together with this file. So this file may use only
// covered_types.h and the number types.
//
//   struct Formula {
//     using Of = …;  // the data that it is made from, besides the view
//     Formula(const CoveredView& view, const Of& of, uint32_t y, uint32_t z);  // places along y
//     and z
//     Six Values(uint32_t x) const;      // P at six places from x on
//     bool IsWithin(uint32_t x) const;   // |P| ≤ h·|∇P| at one place
//   };
#pragma once

#include "gpu/cuda/covered_types.h"
#include "gpu/implicit/row.h"

namespace voxeld::gpu::cuda {

using Six = implicit::Lanes<6>;

inline constexpr int32_t kCoveredRim =
    kCoveredEdge + 2;  // voxels of a tile's row and those around it
inline constexpr uint32_t kCoveredAcross = kCoveredRim * kCoveredRim;
inline constexpr uint32_t kCoveredThreads = (kCoveredAcross + 31) / 32 * 32;
inline constexpr uint32_t kCoveredBlocks = 3;  // per multiprocessor
inline constexpr uint32_t kCoveredAtOnce = 8;  // items that a block of threads handles

struct CoveredScratch {
  float p[kCoveredRim][kCoveredAcross];  // by place along x, then row: y first, then z
  // By row: bit x + 1 says for voxel x of the tile whether it is inside, and whether it may lie
  // within the shell.
  uint32_t inside[kCoveredAcross], near[kCoveredAcross];
  // For the tile's own rows, y first, then z: bit x says whether the voxel is covered.
  uint32_t covered[kCoveredRows];
  // The number of listed voxels, which any free thread tests: x, then y, then z, four bits each.
  uint32_t doubtful;
  uint16_t list[kCoveredRows * kCoveredEdge];
};

// The voxels of an item that lie in the bounds.
struct CoveredTile {
  int32_t lo[3], size[3];
  int32_t skipped[3];  // voxels of the tile before those

  __device__ CoveredTile(const CoveredView& view, uint32_t item) {
    const uint32_t nx = static_cast<uint32_t>(view.blocks[0]),
                   ny = static_cast<uint32_t>(view.blocks[1]);
    const uint32_t at[3] = {item % nx, item / nx % ny, item / nx / ny};
    for (int a = 0; a < 3; ++a) {
      const int32_t begin = (view.first[a] + static_cast<int32_t>(at[a])) * kCoveredEdge;
      lo[a] = begin > view.lo[a] ? begin : view.lo[a];
      skipped[a] = lo[a] - begin;
      const int32_t end = begin + kCoveredEdge < view.hi[a] ? begin + kCoveredEdge : view.hi[a];
      size[a] = end - lo[a];
    }
  }
  // Returns the place, in CoveredAxis, of the voxel before the tile's first.
  __device__ uint32_t PlaceBefore(const CoveredView& view, int a) const {
    return static_cast<uint32_t>(lo[a] - view.lo[a]);
  }
  // Returns the bits of the voxels that exist in row (y, z); the first voxel's is bit 0.
  __device__ uint32_t Within(int32_t y, int32_t z) const {
    const bool is_there = y >= 0 && z >= 0 && y < size[1] && z < size[2];
    return is_there ? (1u << size[0]) - 1 : 0;
  }
};

// Returns, as bits in the order of CoveredScratch, a row's voxels that have a neighbour on the
// other side.
__device__ inline uint32_t BesideOthers(const CoveredScratch& s, uint32_t row, bool cover) {
  const uint32_t own = s.inside[row];
  uint32_t others = own ^ own << 1 | own ^ own >> 1;
  if (!cover) {
    return others | own ^ s.inside[row - 1] | own ^ s.inside[row + 1] |
           own ^ s.inside[row - kCoveredRim] | own ^ s.inside[row + kCoveredRim];
  }
  for (int32_t k = 0; k < 9; ++k) {
    const uint32_t beside =
        s.inside[static_cast<int32_t>(row) + (k / 3 - 1) * kCoveredRim + k % 3 - 1];
    others |= own ^ beside | own ^ beside << 1 | own ^ beside >> 1;
  }
  return others;
}

// Returns whether the voxel at `x` of the row, both counted from the rim on, has a neighbour on the
// other side whose |P| is not less; NaN counts as infinite.
__device__ inline bool IsNearest(const CoveredScratch& s, uint32_t row, int32_t x, bool cover) {
  const float p = s.p[x][row];
  const bool inside = p <= 0;
  const auto magnitude = [](float q) {
    return implicit::IsNan(q) ? implicit::Infinity() : implicit::Abs(q);
  };
  const float mine = magnitude(p);
  const auto meets = [&](int32_t dx, int32_t across) {
    const float q = s.p[x + dx][static_cast<int32_t>(row) + across];
    return (q <= 0) != inside && mine <= magnitude(q);
  };
  if (!cover) {
    return meets(-1, 0) || meets(1, 0) || meets(0, -1) || meets(0, 1) || meets(0, -kCoveredRim) ||
           meets(0, kCoveredRim);
  }
  for (int32_t n = 0; n < 27; ++n) {
    if (meets(n % 3 - 1, (n / 9 - 1) * kCoveredRim + n / 3 % 3 - 1)) return true;
  }
  return false;
}

// Computes P for a tile and the voxels around it. Called by the whole block.
template <class Formula>
__device__ void FindCoveredValues(const CoveredView& view, const typename Formula::Of& of,
                                  const CoveredTile& tile, float reach, CoveredScratch& s) {
  const uint32_t row = threadIdx.x;
  if (row < kCoveredAcross) {
    const uint32_t x = tile.PlaceBefore(view, 0);
    const Formula formula(view, of, tile.PlaceBefore(view, 1) + row % kCoveredRim,
                          tile.PlaceBefore(view, 2) + row / kCoveredRim);
    uint32_t inside = 0, near = 0;
#pragma unroll 1
    for (uint32_t first = 0; first < kCoveredRim; first += 6) {
      const Six p = formula.Values(x + first);
#pragma unroll
      for (uint32_t i = 0; i < 6; ++i) {
        s.p[first + i][row] = p.at[i];
        inside |= (p.at[i] <= 0 ? 1u : 0u) << (first + i);
        near |= (implicit::Abs(p.at[i]) <= reach ? 1u : 0u) << (first + i);
      }
    }
    s.inside[row] = inside;
    s.near[row] = near;
  }
  __syncthreads();
}

// Lists voxels of the tile's row `own`, given as bits. Called by a whole warp.
__device__ inline void ListDoubtful(uint32_t bits, uint32_t own, CoveredScratch& s) {
  const uint32_t lane = threadIdx.x % 32, count = static_cast<uint32_t>(__popc(bits));
  uint32_t until = count;
  for (uint32_t lanes = 1; lanes < 32; lanes <<= 1) {
    const uint32_t other = __shfl_up_sync(0xFFFFFFFFu, until, lanes);
    if (lane >= lanes) until += other;
  }
  uint32_t place = 0;
  if (lane == 31 && until != 0) place = atomicAdd(&s.doubtful, until);
  place = __shfl_sync(0xFFFFFFFFu, place, 31) + until - count;
  for (; bits != 0; bits &= bits - 1) {
    const uint32_t x = static_cast<uint32_t>(__ffs(static_cast<int>(bits))) - 1;
    s.list[place++] = static_cast<uint16_t>(own << 4 | x);
  }
}

// A listed voxel.
struct DoubtfulVoxel {
  uint32_t own, x, y, z;

  __device__ explicit DoubtfulVoxel(uint32_t listed)
      : own(listed >> 4), x(listed & 15), y(listed >> 4 & 15), z(listed >> 8) {}
  __device__ uint32_t row() const { return (z + 1) * kCoveredRim + y + 1; }
};

// Calls f(voxel), which returns whether the voxel is covered, for each listed voxel, and clears the
// list. Called by the whole block.
template <class F>
__device__ void JudgeDoubtful(CoveredScratch& s, F&& f) {
  __syncthreads();
  const uint32_t count = s.doubtful;
  for (uint32_t i = threadIdx.x; i < count; i += kCoveredThreads) {
    const DoubtfulVoxel voxel(s.list[i]);
    if (f(voxel)) atomicOr(&s.covered[voxel.own], 1u << voxel.x);
  }
  __syncthreads();
  if (threadIdx.x == 0) s.doubtful = 0;
  __syncthreads();
}

// Computes which voxels of the tile a surface covers. Called by the whole block.
template <class Formula>
__device__ void FindCoveredSurface(const CoveredView& view, const typename Formula::Of& of,
                                   const CoveredTile& tile, CoveredScratch& s) {
  const uint32_t own = threadIdx.x;
  const uint32_t row = (own / kCoveredEdge + 1) * kCoveredRim + own % kCoveredEdge + 1;
  uint32_t there = 0;
  if (own < kCoveredRows) {
    there = tile.Within(static_cast<int32_t>(own % kCoveredEdge),
                        static_cast<int32_t>(own / kCoveredEdge));
    const uint32_t beside = BesideOthers(s, row, view.cover) >> 1 & there;
    // Without a shell, voxels with P = 0 are covered.
    const uint32_t zero = view.half == 0 ? s.near[row] >> 1 & there : 0;
    s.covered[own] = zero;
    ListDoubtful(beside & ~zero, own, s);
  }
  JudgeDoubtful(s, [&](const DoubtfulVoxel& voxel) {
    return IsNearest(s, voxel.row(), static_cast<int32_t>(voxel.x) + 1, view.cover);
  });
  if (view.half == 0) return;
  if (own < kCoveredRows) {
    ListDoubtful(s.near[row] >> 1 & there & ~s.covered[own], own, s);
  }
  JudgeDoubtful(s, [&](const DoubtfulVoxel& voxel) {
    const Formula formula(view, of, tile.PlaceBefore(view, 1) + 1 + voxel.y,
                          tile.PlaceBefore(view, 2) + 1 + voxel.z);
    return formula.IsWithin(tile.PlaceBefore(view, 0) + 1 + voxel.x);
  });
}

// Computes an item's rows. Called by the whole block.
template <class Formula>
__device__ void FindCoveredTile(const CoveredView& view, const typename Formula::Of& of,
                                uint32_t item, float reach, bool whole, CoveredScratch& s) {
  const CoveredTile tile(view, item);
  if (!whole) {
    FindCoveredValues<Formula>(view, of, tile, reach, s);
    if (!view.solid) FindCoveredSurface<Formula>(view, of, tile, s);
  }
  if (threadIdx.x < kCoveredRows) {
    const int32_t y = static_cast<int32_t>(threadIdx.x) % kCoveredEdge - tile.skipped[1],
                  z = static_cast<int32_t>(threadIdx.x) / kCoveredEdge - tile.skipped[2];
    uint32_t covered = tile.Within(y, z);
    if (covered != 0 && !whole) {
      covered &= view.solid ? s.inside[(z + 1) * kCoveredRim + y + 1] >> 1
                            : s.covered[z * kCoveredEdge + y];
    }
    view.rows[size_t{item} * kCoveredRows + threadIdx.x] =
        static_cast<uint16_t>(covered << tile.skipped[0]);
  }
  __syncthreads();
}

// The same values as Implicit::kNothing and kEverything.
inline constexpr float kCoversNothing = -1, kCoversEverything = -2;

// Computes the rows of kCoveredAtOnce items, if anything in them is covered.
template <class Formula>
__device__ void FindCoveredItems(const CoveredView& view, const typename Formula::Of& of,
                                 CoveredScratch& s) {
  if (threadIdx.x == 0) s.doubtful = 0;  // before the first barrier
  for (uint32_t i = 0; i < kCoveredAtOnce; ++i) {
    const uint32_t item = blockIdx.x * kCoveredAtOnce + i;
    if (item >= view.items) return;  // the same for every thread, as is the code below
    const float reach = __ldg(&view.reach[item]);
    if (reach == kCoversNothing) continue;
    FindCoveredTile<Formula>(view, of, item, reach, reach == kCoversEverything, s);
  }
}

// ---------------------------------------------------------------------------- compiled formulas

// Reads a value for a row's formula: N is a number, several side by side, or either with gradients.
__device__ inline float CoveredValue(const CoveredAxis& axis, uint32_t value, uint32_t place,
                                     float) {
  return __ldg(&axis.value[(value - axis.first) * axis.places + place]);
}
__device__ inline Six CoveredValue(const CoveredAxis& axis, uint32_t value, uint32_t place, Six) {
  const float* const at = &axis.value[(value - axis.first) * axis.places + place];
  return implicit::EachOf<6>([&](size_t i) { return __ldg(at + i); });
}
__device__ inline implicit::Dual<float> CoveredValue(const CoveredAxis& axis, uint32_t value,
                                                     uint32_t place, implicit::Dual<float>) {
  const CoveredDual dual = axis.dual[(value - axis.first) * axis.places + place];
  return {dual.value, {dual.d[0], dual.d[1], dual.d[2]}};
}
__device__ inline float CoveredDistance(const CoveredAxis& axis, uint32_t place, float) {
  return __ldg(&axis.distance[place]);
}
__device__ inline Six CoveredDistance(const CoveredAxis& axis, uint32_t place, Six) {
  return implicit::EachOf<6>([&](size_t i) { return __ldg(&axis.distance[place + i]); });
}

// The place at which a formula is evaluated: places along x (the first, for Six), y and z.
template <class N>
struct CoveredAt {
  const CoveredView& view;
  uint32_t x, y, z;

  __device__ N Hoisted(int axis, uint32_t value) const {
    return CoveredValue(view.axis[axis], value, axis == 0 ? x : axis == 1 ? y : z, N());
  }
  // Returns an instruction's immediate, by its place among the words of hoisted.h.
  __device__ N Constant(uint32_t word) const {
    return implicit::ConstantLike(N(), implicit::FromBits(__ldg(&view.hoisted[word])));
  }
  __device__ N Voxel() const { return implicit::ConstantLike(N(), view.voxel); }

  // The same as Field::Coordinates.
  template <class M>
  __device__ M CoordinateOf(int r, M like) const {
    const float* const row = view.inverse[r];
    const auto times = [&](float a, const M& d) {
      return implicit::Mul(implicit::ConstantLike(like, a), d);
    };
    const M sum = implicit::Add(
        implicit::Add(
            times(row[0], CoveredDistance(view.axis[0], x, like)),
            times(row[1], implicit::Spread(CoveredDistance(view.axis[1], y, 0.0f), like))),
        times(row[2], implicit::Spread(CoveredDistance(view.axis[2], z, 0.0f), like)));
    return implicit::Add(sum, implicit::ConstantLike(like, 0.0f));
  }
  __device__ Six Coordinate(int r, Six like) const { return CoordinateOf(r, like); }
  __device__ implicit::Dual<float> Coordinate(int r, implicit::Dual<float>) const {
    const float* const row = view.inverse[r];
    return {CoordinateOf(r, 0.0f), {row[0], row[1], row[2]}};
  }
  __device__ N Coordinate(int r) const { return Coordinate(r, N()); }
};

// A Formula made from compiled text (implicit/formula_text.h).
template <class Compiled>
class CompiledFormula {
 public:
  struct Of {};
  __device__ CompiledFormula(const CoveredView& view, const Of&, uint32_t y, uint32_t z)
      : view_(view), y_(y), z_(z), row_(CoveredAt<float>{view, 0, y, z}) {}

  __device__ Six Values(uint32_t x) const {
    return Compiled::template Value<Six>(row_, CoveredAt<Six>{view_, x, y_, z_});
  }
  __device__ bool IsWithin(uint32_t x) const {
    using Dual = implicit::Dual<float>;
    const CoveredAt<Dual> at{view_, x, y_, z_};
    const typename Compiled::template Row<Dual> row(at);
    const Dual p = Compiled::template Value<Dual>(row, at);
    return implicit::Abs(p.value) <= view_.half * implicit::SlopeOf(p);
  }

 private:
  const CoveredView& view_;
  const uint32_t y_, z_;
  const typename Compiled::template Row<float> row_;
};

}  // namespace voxeld::gpu::cuda
