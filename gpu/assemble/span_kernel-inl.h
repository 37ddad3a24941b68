// What span_kernel.cc calls, once for each instruction set.
#if defined(VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_
#undef VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_
#endif

#include "gpu/assemble/draw_block-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

// The smallest whole number at or above q, a crossing's (line_walk.h): q > −2⁵².
HWY_INLINE int64_t CeilCrossing(double q) {
  q -= 0x1p-36;
  const auto k = static_cast<int64_t>(q);
  return k + static_cast<int64_t>(static_cast<double>(k) < q);
}

// An axis of a walk, reflected if it goes down: then it goes up.
struct UpwardAxis {
  int64_t at, step;
  bool down;
  HWY_INLINE UpwardAxis(int64_t walk_at, int64_t walk_step)
      : at(walk_step < 0 ? ~walk_at : walk_at),
        step(walk_step < 0 ? -walk_step : walk_step),
        down(walk_step < 0) {}
  // The first k whose coordinate is `voxel` (reflected) or beyond; at most `most`.
  HWY_INLINE int64_t FirstAt(int64_t voxel, int64_t most) const {
    const int64_t way = voxel * (int64_t{1} << 32) - at;
    if (way <= 0) return 0;
    if (step == 0) return most;
    const double q = static_cast<double>(way) / static_cast<double>(step);
    return q >= static_cast<double>(most) ? most : std::min(most, CeilCrossing(q));
  }
};

// The k inside the volume.
HWY_NOINLINE inline void ClipToVolume(const LineWalk& walk, const WalkGrid& grid, int64_t* begin,
                                      int64_t* end) {
  const int64_t most = *end;
  for (int r = 0; r < 3; ++r) {
    const UpwardAxis up(walk.at(r), walk.step(r));
    const int64_t lo = up.down ? -int64_t{grid.voxels[r]} : 0;
    *begin = std::max(*begin, up.FirstAt(lo, most));
    *end = std::min(*end, up.FirstAt(lo + grid.voxels[r], most));
  }
}

HWY_ATTR HWY_INLINE void FindSpansOf(const LineWalk& walk, uint32_t item, const WalkGrid& grid,
                                     const uint8_t* owned, FoundSpans& found) {
  constexpr size_t kMostCrossings = kMostWalkSteps / kTileSize + 3;
  const hn::CappedTag<double, 8> d;
  const size_t lanes = hn::Lanes(d);
  int32_t crossings[3][kMostCrossings + 8];
  int64_t begin = 0, end = walk.steps() + 1;
  int64_t at[3], step[3], first[3], last[3], outside = 0;
  for (int r = 0; r < 3; ++r) {
    at[r] = walk.at(r);
    step[r] = walk.step(r);
    first[r] = at[r] >> 32;
    last[r] = (at[r] + step[r] * (end - 1)) >> 32;
    outside |=
        first[r] | (grid.voxels[r] - 1 - first[r]) | last[r] | (grid.voxels[r] - 1 - last[r]);
  }
  if (outside < 0) {
    ClipToVolume(walk, grid, &begin, &end);
    if (begin >= end) return;
    for (int r = 0; r < 3; ++r) {
      first[r] = (at[r] + step[r] * begin) >> 32;
      last[r] = (at[r] + step[r] * (end - 1)) >> 32;
    }
  }
  int32_t tile_step[3];
  int32_t tile = 0;
  size_t count[3];
  double way[3], inverse[3];  // to the first face of a tile that is crossed, and of a step
  const auto sentinel = static_cast<int32_t>(end);
  for (int r = 0; r < 3; ++r) {
    const int64_t from = first[r] >> kTileBits, to = last[r] >> kTileBits;
    tile += static_cast<int32_t>(from) * grid.tile_step[r];
    // −1 if it goes down, for a reflection without a branch: nobody could foresee which way it goes.
    const int64_t down = -static_cast<int64_t>(to < from);
    const auto down32 = static_cast<int32_t>(down);
    tile_step[r] = (grid.tile_step[r] ^ down32) - down32;
    count[r] = static_cast<size_t>(((to - from) ^ down) - down);
    const int64_t face = (from ^ down) + 1;  // of tiles
    way[r] = static_cast<double>(face * (int64_t{1} << 36) - (at[r] ^ down));
    // Where none is crossed the step may be 0 or go the other way.
    inverse[r] = 1.0 / static_cast<double>(std::max<int64_t>((step[r] ^ down) - down, 1));
  }
  if ((count[0] | count[1] | count[2]) <= 3) {
    // Short lines, without branches.
    for (int r = 0; r < 3; ++r) {
      for (size_t j = 0; j < 3; ++j) {
        const int64_t k = CeilCrossing((way[r] + 0x1p36 * static_cast<double>(j)) * inverse[r]);
        crossings[r][j] = j < count[r] ? static_cast<int32_t>(k) : sentinel;
      }
      crossings[r][3] = sentinel;
    }
  } else {
    const hn::Rebind<int32_t, decltype(d)> di;
    const auto room = hn::Set(d, 0x1p-36), tiles = hn::Mul(hn::Iota(d, 0), hn::Set(d, 0x1p36));
    const auto all = hn::Set(d, 0x1p36 * static_cast<double>(lanes));
    for (int r = 0; r < 3; ++r) {
      const auto by = hn::Set(d, inverse[r]);
      auto ways = hn::Add(hn::Set(d, way[r]), tiles);
      for (size_t j = 0; j < count[r]; j += lanes) {
        const auto k = hn::Ceil(hn::Sub(hn::Mul(ways, by), room));
        hn::StoreU(hn::DemoteTo(di, k), di, crossings[r] + j);
        ways = hn::Add(ways, all);
      }
      crossings[r][count[r]] = sentinel;
    }
  }

  const size_t most = count[0] + count[1] + count[2] + 1;
  found.tiles.Reserve(found.size, most);
  found.items.Reserve(found.size, most);
  uint32_t* const tiles = found.tiles.data();
  BinItem* const items = found.items.data();
  size_t size = found.size;
  const int32_t *x = crossings[0], *y = crossings[1], *z = crossings[2];
  auto k = static_cast<int32_t>(begin);
  for (;;) {
    const int32_t next = std::min(*x, std::min(*y, *z));
    tiles[size] = static_cast<uint32_t>(tile);
    items[size] = BinItem::Span(item, static_cast<uint32_t>(k), static_cast<uint32_t>(next - k));
    size += owned[tile] != 0;
    if (next == sentinel) break;
    const bool in_x = *x == next, in_y = *y == next, in_z = *z == next;
    x += in_x;
    y += in_y;
    z += in_z;
    tile += (in_x ? tile_step[0] : 0) + (in_y ? tile_step[1] : 0) + (in_z ? tile_step[2] : 0);
    k = next;
  }
  found.size = size;
}

HWY_ATTR inline void FindSpansIn(const LineWalk* walks, uint32_t first, uint32_t last,
                                 const WalkGrid& grid, const uint8_t* owned, FoundSpans& found) {
  for (uint32_t i = first; i < last; ++i) FindSpansOf(walks[i], i, grid, owned, found);
}

#if HWY_TARGET == HWY_SCALAR

inline void DrawSpansIn(const LineWalk* walks, std::span<const BinItem> items, uint32_t* words,
                        TileRows& touched) {
  touched = TileRows::All();
  constexpr uint32_t kShift[3] = {27, 23, 19};
  for (const BinItem& item : items) {
    const LineWalk& walk = walks[item.item];
    uint32_t p[3];
    for (int r = 0; r < 3; ++r) {
      p[r] = static_cast<uint32_t>((walk.at(r) + walk.step(r) * item.first()) >> 5) + 1;
    }
    for (uint32_t left = item.count(); left > 0; --left) {
      uint32_t at = 0;
      for (int r = 0; r < 3; ++r) {
        at |= p[r] >> kShift[r] & 0xFu << (4 * r);
        p[r] += static_cast<uint32_t>(walk.stride[r]) + 1;
      }
      words[at] = std::max(words[at], walk.word);
    }
  }
}

#else

HWY_ATTR inline void DrawSpansIn(const LineWalk* walks, std::span<const BinItem> items,
                                 uint32_t* words, TileRows& touched) {
  constexpr size_t kAhead = 24;
  static_assert(sizeof(LineWalk) == 32, "two vectors of 128 bits");
  const DW d;
  const size_t lanes = hn::Lanes(d);
  const VW iota = hn::Iota(d, 0), all = hn::Set(d, static_cast<uint32_t>(lanes));
  const VW mask0 = hn::Set(d, 0xF), mask1 = hn::Set(d, 0xF0), mask2 = hn::Set(d, 0xF00);
  const VW five_bits = hn::Set(d, 31), one = hn::Set(d, 1);
  HWY_ALIGN static constexpr uint32_t kFive[4] = {0, 5, 10, 0};
  const VW rest_at = hn::LoadDup128(d, kFive);
  for (size_t i = 0; i < std::min(kAhead, items.size()); ++i) {
    hwy::Prefetch(walks + items[i].item);
  }
  DrawBlock block;
  size_t size = 0;
  bool several = false;
  for (size_t i = 0; i < items.size(); ++i) {
    if (i + kAhead < items.size()) hwy::Prefetch(walks + items[i + kAhead].item);
    const BinItem item = items[i];
    const LineWalk& walk = walks[item.item];
    const uint32_t count = item.count();
    // In each block of four lanes: three axes and the word; three axes and what is left of their steps.
    const VW start = hn::LoadDup128(d, reinterpret_cast<const uint32_t*>(walk.start));
    const VW stride = hn::LoadDup128(d, reinterpret_cast<const uint32_t*>(walk.stride));
    const VW rest = hn::And(hn::Shr(hn::Broadcast<3>(stride), rest_at), five_bits);
    const VW k = hn::Set(d, item.first());
    const VW from = hn::Add(hn::Add(hn::ShiftLeft<19>(start), hn::Mul(stride, k)),
                            hn::Add(hn::ShiftRight<5>(hn::Mul(rest, k)), one));
    const VW by = hn::Add(stride, one);
    const VW x_step = hn::Broadcast<0>(by), y_step = hn::Broadcast<1>(by),
             z_step = hn::Broadcast<2>(by);
    VW x = hn::Add(hn::Broadcast<0>(from), hn::Mul(x_step, iota));
    VW y = hn::Add(hn::Broadcast<1>(from), hn::Mul(y_step, iota));
    VW z = hn::Add(hn::Broadcast<2>(from), hn::Mul(z_step, iota));
    const VW word = hn::Broadcast<3>(start);
    for (uint32_t done = 0;;) {
      const VW at = hn::Or(
          hn::And(hn::ShiftRight<27>(x), mask0),
          hn::Or(hn::And(hn::ShiftRight<23>(y), mask1), hn::And(hn::ShiftRight<19>(z), mask2)));
      hn::StoreU(at, d, block.at + size + done);
      hn::StoreU(word, d, block.words + size + done);
      done += static_cast<uint32_t>(lanes);
      if (HWY_LIKELY(done >= count)) break;
      x = hn::Add(x, hn::Mul(x_step, all));
      y = hn::Add(y, hn::Mul(y_step, all));
      z = hn::Add(z, hn::Mul(z_step, all));
    }
    size += count;
    if (size >= DrawBlock::kSize) {
      RaiseBlock(block, size, words);
      size = 0;
      several = true;
    }
  }
  RaiseLast(block, size, several, words, touched);
}

#endif

// A row of words: `show(v)` is what becomes of a vector, `put` where it goes. True if some are not 0; counts them in `lit`.
template <typename Show, typename Put>
HWY_ATTR HWY_INLINE bool LitRow(const uint32_t* words, size_t at, const Show& show, const Put& put,
                                VW& lit) {
  const DW d;
  const VW zero = hn::Zero(d);
  VW any = zero;
  for (size_t i = at; i < at + kTileSize; i += hn::Lanes(d)) {
    const VW shown = show(hn::Load(d, words + i));
    put(shown, i);
    any = hn::Or(any, shown);
    lit = hn::Sub(lit, hn::VecFromMask(d, hn::Ne(shown, zero)));  // all ones: −1
  }
  return !hn::AllTrue(d, hn::Eq(any, zero));
}

template <typename Show, typename Put>
HWY_ATTR HWY_INLINE uint32_t LitRows(const uint32_t* words, const TileRows& touched,
                                     const Show& show, const Put& put, TileRows& rows) {
  const DW d;
  VW lit = hn::Zero(d);
  for (size_t group = 0; group < TileRows::kGroups; ++group) {
    uint64_t bits = 0;
    const uint64_t all = touched.bits[group];
    if (all == ~uint64_t{0}) {
      for (size_t r = 0; r < 64; ++r) {
        bits |= uint64_t{LitRow(words, (group * 64 + r) * kTileSize, show, put, lit)} << r;
      }
    } else {
      for (uint64_t left = all; left != 0; left &= left - 1) {
        const auto r = static_cast<size_t>(std::countr_zero(left));
        bits |= uint64_t{LitRow(words, (group * 64 + r) * kTileSize, show, put, lit)} << r;
      }
    }
    rows.bits[group] = bits;
  }
  return hn::GetLane(hn::SumOfLanes(d, lit));
}

HWY_ATTR inline uint32_t ShowWordsIn(uint32_t* words, const TileRows& touched, TileRows& rows) {
  const DW d;
  const VW color = hn::Set(d, kColorMask), erase = hn::Set(d, kEraseBit), zero = hn::Zero(d);
  const auto show = [&](VW word) HWY_ATTR {
    return hn::IfThenElseZero(hn::Eq(hn::And(word, erase), zero), hn::And(word, color));
  };
  const auto put = [&](VW shown, size_t i) HWY_ATTR { hn::Store(shown, d, words + i); };
  return LitRows(words, touched, show, put, rows);
}

HWY_ATTR inline uint32_t LitColorsIn(const uint32_t* colors, TileRows& rows) {
  return LitRows(
      colors, TileRows::All(), [](VW color) HWY_ATTR { return color; }, [](VW, size_t) HWY_ATTR {},
      rows);
}

template <bool kPastCaches>
HWY_ATTR HWY_INLINE void MoveRow(uint32_t* from, uint32_t* to) {
  const DW d;
  for (size_t i = 0; i < kTileSize; i += hn::Lanes(d)) {
    const VW color = hn::Load(d, from + i);
    if constexpr (kPastCaches) {
      hn::Stream(color, d, to + i);
    } else {
      hn::Store(color, d, to + i);
    }
    hn::Store(hn::Zero(d), d, from + i);
  }
}

// Whether two rows differ.
HWY_ATTR HWY_INLINE bool RowsDiffer(const uint32_t* a, const uint32_t* b) {
  const DW d;
  VW differ = hn::Zero(d);
  for (size_t i = 0; i < kTileSize; i += hn::Lanes(d)) {
    differ = hn::Or(differ, hn::Xor(hn::Load(d, a + i), hn::Load(d, b + i)));
  }
  return !hn::AllTrue(d, hn::Eq(differ, hn::Zero(d)));
}

HWY_ATTR inline bool MoveColorsIn(uint32_t* colors, const TileRows& rows, bool past_caches,
                                  uint32_t* held, const TileRows& held_rows) {
  bool same = true;
  for (size_t group = 0; group < TileRows::kGroups; ++group) {
    for (uint64_t left = rows.bits[group] | held_rows.bits[group]; left != 0; left &= left - 1) {
      const size_t at = (group * 64 + static_cast<size_t>(std::countr_zero(left))) * kTileSize;
      // What is held is looked at no further than to where it differs.
      if (same) same = !RowsDiffer(colors + at, held + at);
      if (past_caches && !same) {
        MoveRow<true>(colors + at, held + at);
      } else {
        MoveRow<false>(colors + at, held + at);
      }
    }
  }
  return !same;
}

inline const char* SpanTargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
