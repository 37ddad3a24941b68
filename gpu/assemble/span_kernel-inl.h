// What span_kernel.cc calls, once for each instruction set.
#if defined(VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_
#undef VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_SPAN_KERNEL_INL_H_
#endif

#include "gpu/assemble/draw_block-inl.h"
#include "gpu/assemble/span_find-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

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
        p[r] += static_cast<uint32_t>(walk.stride[r]);
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
  // What a span begins with, of three axes at once.
  const hn::CappedTag<uint32_t, 4> d4;
  using V4 = hn::Vec<decltype(d4)>;
  HWY_ALIGN static constexpr uint32_t kFive[4] = {0, 5, 10, 0};
  const V4 rest_at = hn::Load(d4, kFive), five_bits = hn::Set(d4, 31);
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
    // Three axes and the word; three axes and what is left of their steps.
    const V4 start = hn::Load(d4, reinterpret_cast<const uint32_t*>(walk.start));
    const V4 stride = hn::Load(d4, reinterpret_cast<const uint32_t*>(walk.stride));
    const V4 rest = hn::And(hn::Shr(hn::Broadcast<3>(stride), rest_at), five_bits);
    const V4 k = hn::Set(d4, item.first());
    // k·⌊step/2⁵⌋ + 1 is k·stride + (1 − k).
    const V4 from =
        hn::Add(hn::Add(hn::ShiftLeft<19>(start), hn::Mul(stride, k)),
                hn::Add(hn::ShiftRight<5>(hn::Mul(rest, k)), hn::Set(d4, 1 - item.first())));
    // Broadcast by the loads: the units that shuffle have enough to do.
    HWY_ALIGN uint32_t first[4];
    hn::Store(from, d4, first);
    const VW x_step = hn::Set(d, static_cast<uint32_t>(walk.stride[0])),
             y_step = hn::Set(d, static_cast<uint32_t>(walk.stride[1])),
             z_step = hn::Set(d, static_cast<uint32_t>(walk.stride[2]));
    VW x = hn::Add(hn::Set(d, first[0]), hn::Mul(x_step, iota));
    VW y = hn::Add(hn::Set(d, first[1]), hn::Mul(y_step, iota));
    VW z = hn::Add(hn::Set(d, first[2]), hn::Mul(z_step, iota));
    const VW word = hn::Set(d, walk.word);
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

// What a word looks like over black in full opacity.
struct ShowWord {
  HWY_ATTR HWY_INLINE VW operator()(VW word) const {
    const DW d;
    const VW color = hn::Set(d, kColorMask), erase = hn::Set(d, kEraseBit), zero = hn::Zero(d);
    return hn::IfThenElseZero(hn::Eq(hn::And(word, erase), zero), hn::And(word, color));
  }
};

HWY_ATTR inline uint32_t ShowWordsIn(uint32_t* words, const TileRows& touched, TileRows& rows) {
  const DW d;
  const auto put = [&](VW shown, size_t i) HWY_ATTR { hn::Store(shown, d, words + i); };
  return LitRows(words, touched, ShowWord(), put, rows);
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
  bool same = rows == held_rows;  // if not, what is held need not be fetched
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

// A row of words to where they are shown; true if some are not black.
template <bool kPastCaches, typename Show>
HWY_ATTR HWY_INLINE bool MoveShownRow(uint32_t* words, const Show& show, uint32_t* held, VW& lit) {
  const DW d;
  const auto put = [&](VW shown, size_t i) HWY_ATTR {
    if constexpr (kPastCaches) {
      hn::Stream(shown, d, held + i);
    } else {
      hn::Store(shown, d, held + i);
    }
    hn::Store(hn::Zero(d), d, words + i);
  };
  return LitRow(words, 0, show, put, lit);
}

HWY_ATTR inline MovedWords MoveWordsIn(uint32_t* words, const TileRows& touched, bool past_caches,
                                       uint32_t* held, TileRows& held_rows) {
  const DW d;
  const ShowWord show;
  VW lit = hn::Zero(d);
  bool same = true;
  for (size_t group = 0; group < TileRows::kGroups; ++group) {
    uint64_t bits = 0;
    for (uint64_t left = touched.bits[group] | held_rows.bits[group]; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      const size_t at = (group * 64 + r) * kTileSize;
      if (same) {
        VW differ = hn::Zero(d);
        for (size_t i = at; i < at + kTileSize; i += hn::Lanes(d)) {
          differ = hn::Or(differ, hn::Xor(show(hn::Load(d, words + i)), hn::Load(d, held + i)));
        }
        same = hn::AllTrue(d, hn::Eq(differ, hn::Zero(d)));
      }
      bits |= uint64_t{past_caches && !same ? MoveShownRow<true>(words + at, show, held + at, lit)
                                            : MoveShownRow<false>(words + at, show, held + at, lit)}
              << r;
    }
    held_rows.bits[group] = bits;
  }
  return {hn::GetLane(hn::SumOfLanes(d, lit)), !same};
}

inline const char* SpanTargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
