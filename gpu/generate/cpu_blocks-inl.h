// Blocks of segments whose arithmetic is done together: units, counts, short segments. Part of
// cpu_kernel.cc, compiled for each instruction set.
#if defined(VOXELD_GPU_GENERATE_CPU_BLOCKS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_GENERATE_CPU_BLOCKS_INL_H_
#undef VOXELD_GPU_GENERATE_CPU_BLOCKS_INL_H_
#else
#define VOXELD_GPU_GENERATE_CPU_BLOCKS_INL_H_
#endif

#include "gpu/generate/cpu_walks-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu::generate {
namespace HWY_NAMESPACE {

using DF = hn::ScalableTag<double>;
using VF = hn::Vec<DF>;
constexpr size_t kBlock = 64;  // segments whose arithmetic is done together

// Loads consecutive coordinates from memory, in units, rounded as by RoundedUnits.
template <typename T>
HWY_ATTR HWY_INLINE VF LoadUnits(const T* from) {
  const DF d;
  const hn::Rebind<T, DF> dt;
  if constexpr (std::is_same_v<T, int32_t>) {
    return hn::Mul(hn::PromoteTo(d, hn::LoadU(dt, from)), hn::Set(d, 65536.0));
  } else {
    VF voxels;
    if constexpr (std::is_same_v<T, double>) {
      voxels = hn::LoadU(d, from);
    } else {
      voxels = hn::PromoteTo(d, hn::LoadU(dt, from));
    }
    const VF units = hn::Mul(voxels, hn::Set(d, 65536.0));
    const VF whole = hn::Floor(units);
    return hn::Add(
        whole, hn::IfThenElseZero(hn::Ge(hn::Sub(units, whole), hn::Set(d, 0.5)), hn::Set(d, 1.0)));
  }
}

// The start and end coordinates of segments (six each), in units, and their common properties.
struct UnitBlock {
  HWY_ALIGN double q[6 * kBlock + 64];
  bool whole;   // all coordinates are whole voxels
  bool within;  // all coordinates are in range
  double lo[3], hi[3];

  template <typename T>
  HWY_ATTR void Load(std::span<const Segment<T>> segments, size_t begin, size_t end) {
    static_assert(sizeof(Segment<T>) == 6 * sizeof(T));
    constexpr double kMost = static_cast<double>(kMostCoordinate * kUnits);
    constexpr double kFar = std::numeric_limits<double>::infinity();
    const DF d;
    const T* from = segments[begin].start.data();
    const size_t values = 6 * (end - begin), lanes = hn::Lanes(d);
    const VF far = hn::Set(d, kFar), most = hn::Set(d, kMost), voxel = hn::Set(d, 1.0 / 65536);
    // Lane l of vector i is axis (lanes·i + l) mod 3: the pattern repeats after three vectors.
    VF least[3] = {far, far, far}, greatest[3] = {hn::Neg(far), hn::Neg(far), hn::Neg(far)};
    auto all_whole = hn::Eq(far, far), all_within = all_whole;
    const auto take = [&](VF units, size_t i, size_t phase) HWY_ATTR {
      hn::Store(units, d, q + i);
      const VF voxels = hn::Mul(units, voxel);
      all_whole = hn::And(all_whole, hn::Eq(voxels, hn::Floor(voxels)));
      all_within = hn::And(all_within, hn::Le(hn::Abs(units), most));  // false for NaN
      least[phase] = hn::Min(least[phase], units);
      greatest[phase] = hn::Max(greatest[phase], units);
    };
    size_t i = 0;
    for (; i + 3 * lanes <= values; i += 3 * lanes) {
      for (size_t v = 0; v < 3; ++v) take(LoadUnits(from + i + v * lanes), i + v * lanes, v);
    }
    HWY_ALIGN double edge[2][3 * HWY_MAX_BYTES / sizeof(double)];
    for (size_t v = 0; v < 3; ++v) {
      hn::Store(least[v], d, edge[0] + v * lanes);
      hn::Store(greatest[v], d, edge[1] + v * lanes);
    }
    whole = hn::AllTrue(d, all_whole);
    within = hn::AllTrue(d, all_within);
    for (size_t a = 0; a < 3; ++a) {
      lo[a] = kFar, hi[a] = -kFar;
      for (size_t l = a; l < 3 * lanes; l += 3)
        lo[a] = std::min(lo[a], edge[0][l]), hi[a] = std::max(hi[a], edge[1][l]);
    }
    // Handles the rest one by one, so that nothing beyond the last coordinate is loaded.
    for (; i < values; ++i) {
      q[i] = RoundedUnits(static_cast<double>(from[i]));
      whole &= q[i] * (1.0 / 65536) == std::floor(q[i] * (1.0 / 65536));
      within &= q[i] >= -kMost && q[i] <= kMost;
      lo[i % 3] = std::min(lo[i % 3], q[i]);
      hi[i % 3] = std::max(hi[i % 3], q[i]);
    }
  }
};

HWY_INLINE double CellsBetween(double a, double b) {
  constexpr double kVoxel = 1.0 / static_cast<double>(kUnits);
  return std::abs(std::floor(b * kVoxel) - std::floor(a * kVoxel));
}

template <typename T>
HWY_ATTR bool CountBlock(std::span<const Segment<T>> segments, Sampling sampling, size_t begin,
                         size_t end, uint64_t* counts, UnitBounds& bounds) {
  UnitBlock block;
  block.Load(segments, begin, end);
  if (!block.within) return false;
  for (size_t a = 0; a < 3; ++a) {
    bounds.lo[a] = std::min(bounds.lo[a], block.lo[a]);
    bounds.hi[a] = std::max(bounds.hi[a], block.hi[a]);
  }
  for (size_t i = begin; i < end; ++i) {
    const double* const q = block.q + 6 * (i - begin);
    if (sampling == Sampling::kEuclidean) {
      // A sum of squares below 2⁵² is exact, and its root is correctly rounded.
      constexpr double kExact = static_cast<double>(int64_t{1} << 52);
      const double x = q[3] - q[0], y = q[4] - q[1], z = q[5] - q[2];
      const double square = x * x + y * y + z * z;
      const auto n = static_cast<int64_t>(std::sqrt(square) * (1.0 / static_cast<double>(kUnits)));
      counts[i] = square >= kExact || n == 0 ? 0 : static_cast<uint64_t>(n) + 1;
      continue;
    }
    const double x = CellsBetween(q[0], q[3]), y = CellsBetween(q[1], q[4]),
                 z = CellsBetween(q[2], q[5]);
    counts[i] = static_cast<uint64_t>(sampling == Sampling::kThin ? std::max(x, std::max(y, z))
                                                                  : x + y + z) +
                1;
  }
  return true;
}

// The same for whole segments of few steps, whose arithmetic is done together. Holds the values
// that EmitShort computes for each segment, in three of every four elements.
struct ShortBlock {
  HWY_ALIGN int32_t cell[4 * kBlock + 16], begin[4 * kBlock + 16], step[4 * kBlock + 16];

  // `zone` and `too_large` are those of the block's longest segment; `apart` holds for all of them.
  HWY_ATTR void Set(const UnitBlock& block, const uint64_t* offsets, size_t count, uint32_t zone,
                    uint32_t too_large, bool apart) {
    const hn::CappedTag<double, 4> d;
    const hn::Rebind<int32_t, decltype(d)> di;
    const auto whole_bias = hn::Set(d, static_cast<double>(zone));
    const auto bias = hn::Set(d, static_cast<double>(apart ? zone : zone - too_large));
    for (size_t i = 0; i < count; ++i) {
      const auto n =
          hn::Set(d, static_cast<double>(std::max<uint64_t>(1, offsets[i + 1] - offsets[i] - 1)));
      for (size_t a = 0; a < 3; a += hn::Lanes(d)) {
        const auto s = hn::LoadU(d, block.q + 6 * i + a), e = hn::LoadU(d, block.q + 6 * i + 3 + a);
        const auto cells = hn::Floor(hn::Mul(s, hn::Set(d, 1.0 / 65536)));
        const auto fraction = hn::Sub(s, hn::Mul(cells, hn::Set(d, 65536.0)));
        // A quotient of such small numbers is rounded to a whole number only if it is whole.
        const auto quotient = hn::Div(hn::Mul(hn::Sub(e, s), hn::Set(d, 64.0)), n);
        const auto one = hn::Ceil(quotient);
        const auto from = hn::Add(hn::Mul(fraction, hn::Set(d, 64.0)),
                                  hn::IfThenElse(hn::Eq(one, quotient), whole_bias, bias));
        hn::StoreU(hn::DemoteTo(di, cells), di, cell + 4 * i + a);
        hn::StoreU(hn::DemoteTo(di, from), di, begin + 4 * i + a);
        hn::StoreU(hn::DemoteTo(di, one), di, step + 4 * i + a);
      }
    }
  }
};

template <Output kOut>
HWY_ATTR void EmitShortBlock(const Spread& spread, const UnitBlock& units, const uint64_t* offsets,
                             size_t count, uint32_t longest, Stage& stage) {
  constexpr int kBits = 22;
  const DU d;
  const hn::RebindToSigned<DU> di;
  const uint32_t too_large = longest + 1, zone = 2 * too_large;
  const uint64_t grain =
      units.whole ? uint64_t{1} << kBits : uint64_t{1} << (kBits - kFractionBits);
  ShortBlock block;
  block.Set(units, offsets, count, zone, too_large, uint64_t{longest} * (zone + too_large) < grain);
  const VU zones = hn::Set(d, zone), fraction = hn::Set(d, (1u << kBits) - 1);
  const auto spread_of = [&](const int32_t* from, size_t v) HWY_ATTR {
    const auto all = hn::LoadDup128(di, from);
    return hn::BitCast(d, hn::TableLookupBytes(all, hn::BitCast(di, spread.bytes[v])));
  };
  for (size_t i = 0; i < count; ++i) {
    const auto n = static_cast<int64_t>(offsets[i + 1] - offsets[i]) - 1;
    VU at[3], advance[3], cells[3];
    for (size_t v = 0; v < 3; ++v) {
      const VU one = spread_of(block.step + 4 * i, v);
      at[v] = hn::Add(spread_of(block.begin + 4 * i, v), hn::Mul(one, spread.voxel[v]));
      advance[v] = hn::ShiftLeft<kLaneBits>(one);
      cells[v] = spread_of(block.cell + 4 * i, v);
    }
    const double* const q = units.q + 6 * i;
    const auto exact = [&](uint32_t k) {
      int32_t c[3];
      for (int a = 0; a < 3; ++a) {
        const auto s = static_cast<int64_t>(q[a]), e = static_cast<int64_t>(q[3 + a]);
        c[a] = static_cast<int32_t>(n == 0 ? CellOf(s)
                                           : FloorDiv<int64_t>(s * n + (e - s) * k, n * kUnits));
      }
      return Voxel{c[0], c[1], c[2]};
    };
    std::byte* const first = stage.next();
    std::byte* to = first;
    VU least = fraction;
    for (auto left = static_cast<int32_t>(n + 1);; left -= static_cast<int32_t>(kLanes)) {
      VU whole[3];
      for (size_t v = 0; v < 3; ++v) {
        whole[v] = hn::Add(cells[v], hn::BitCast(d, hn::ShiftRight<kBits>(hn::BitCast(di, at[v]))));
        least = hn::Min(least, hn::And(at[v], fraction));
      }
      StoreSpread<kOut>(whole[0], whole[1], whole[2], to);
      to += kLanes * BytesOf(kOut);
      if (left <= static_cast<int32_t>(kLanes)) break;
      for (size_t v = 0; v < 3; ++v) at[v] = hn::Add(at[v], advance[v]);
    }
    if (HWY_UNLIKELY(!hn::AllFalse(d, hn::Lt(least, zones)))) {
      StoreExact<kOut>(0, static_cast<uint32_t>(n + 1), first, exact);
    }
    stage.Add(static_cast<size_t>(n + 1) * BytesOf(kOut));
  }
}

// Returns how many of the segments from `i` on are short, of those whose voxels are all wanted, and
// the steps of the longest in `longest`.
inline size_t ShortFrom(std::span<const uint64_t> offsets, size_t i, uint64_t end,
                        uint32_t* longest) {
  size_t count = 0;
  *longest = 0;
  while (count < kBlock && i + count + 1 < offsets.size() && offsets[i + count + 1] <= end) {
    const uint64_t steps = offsets[i + count + 1] - offsets[i + count] - 1;
    if (steps > static_cast<uint64_t>(kShortSteps)) break;
    *longest = std::max(*longest, static_cast<uint32_t>(steps));
    ++count;
  }
  return count;
}

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu::generate
HWY_AFTER_NAMESPACE();

#endif
