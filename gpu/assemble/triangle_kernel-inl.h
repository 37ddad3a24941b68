// How triangle_kernel.cc draws runs of small triangles (triangle_runs.h), once for each instruction set.
#if defined(VOXELD_GPU_ASSEMBLE_TRIANGLE_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_TRIANGLE_KERNEL_INL_H_
#undef VOXELD_GPU_ASSEMBLE_TRIANGLE_KERNEL_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_TRIANGLE_KERNEL_INL_H_
#endif

#include "gpu/assemble/draw_block-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

// Words of one face in a tile.
struct FacePlaces {
  static constexpr size_t kMost = kTileSize * kTileSize + 4 * 64 + 3;
  static constexpr size_t kRoom = 32;

  HWY_ALIGN uint32_t at[kMost + kRoom];
  size_t size = 0;
};

HWY_ATTR HWY_INLINE void RaisePlaces(const FacePlaces& places, uint32_t word, uint32_t* words) {
  const hn::CappedTag<uint32_t, 1> d;  // without a branch that nobody could foresee
  const auto raised = hn::Set(d, word);
  const auto raise = [&](size_t i) HWY_ATTR {
    uint32_t* const at = words + places.at[i];
    hn::StoreU(hn::Max(hn::LoadU(d, at), raised), d, at);
  };
  size_t i = 0;
  for (; i + 4 <= places.size; i += 4) {
    raise(i);
    raise(i + 1);
    raise(i + 2);
    raise(i + 3);
  }
  for (; i < places.size; ++i) raise(i);
}

// Columns `first` on, `count` of them, in row k of a face, by the definition's division.
HWY_NOINLINE inline void PlaceExactly(const TriangleRuns& face, int32_t k, int32_t first,
                                      int32_t count, int32_t from_a, int32_t size_a,
                                      uint32_t at_first, FacePlaces& places) {
  const int64_t divisor = int64_t{face.divisor} * 256;
  for (int32_t lane = 0; lane < count; ++lane) {
    const int64_t numerator = face.numerator + int64_t{face.step_u} * 256 * k +
                              int64_t{face.step_v} * 256 * (first + lane);
    const int64_t above = FloorDiv(numerator, divisor) - from_a;
    if (above < 0 || above >= size_a) continue;
    places.at[places.size++] = at_first + (static_cast<uint32_t>(lane) << (4 * face.v)) +
                               (static_cast<uint32_t>(above) << (4 * face.a));
  }
}

// What of a face lies in the tile that begins at voxel `from`, counted from the face's origin, and has `size` voxels.
HWY_ATTR HWY_INLINE void PlaceFace(const TriangleRuns& face, const int32_t from[3],
                                   const int32_t size[3], FacePlaces& places) {
  const DW du;
  const hn::RebindToSigned<DW> d;
  const hn::Rebind<uint16_t, DW> d16;
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  const int a = face.a, u = face.u, v = face.v;
  const int32_t k_begin = std::max(0, from[u]),
                k_end = std::min<int32_t>(face.rows, from[u] + size[u]);
  HWY_ALIGN uint32_t depths[kTileSize + 16], at_first[kTileSize + 16];
  HWY_ALIGN int32_t firsts[kTileSize + 16], counts[kTileSize + 16];
  // Where each row's run begins.
  const auto depth0 =
      hn::Set(du, face.depth - (static_cast<uint32_t>(from[a]) << kDepthBits));
  const auto iota = hn::Iota(d, 0);
  for (int32_t row = k_begin; row < k_end; row += lanes) {
    const auto k = hn::Add(hn::Set(d, row), iota);
    const auto run = hn::PromoteTo(du, hn::LoadU(d16, face.runs() + row));
    const auto first = hn::Max(hn::BitCast(d, hn::And(run, hn::Set(du, 0xFF))),
                               hn::Set(d, from[v]));
    const auto end = hn::Min(hn::BitCast(d, hn::ShiftRight<8>(run)),
                             hn::Set(d, from[v] + size[v]));
    const auto depth = hn::Add(
        depth0, hn::Add(hn::Mul(hn::BitCast(du, k), hn::Set(du, face.fall_u)),
                        hn::Mul(hn::BitCast(du, first), hn::Set(du, face.fall_v))));
    const auto at =
        hn::Add(hn::ShiftLeftSame(hn::Sub(k, hn::Set(d, from[u])), 4 * u),
                hn::ShiftLeftSame(hn::Sub(first, hn::Set(d, from[v])), 4 * v));
    hn::StoreU(depth, du, depths + (row - k_begin));
    hn::StoreU(hn::BitCast(du, at), du, at_first + (row - k_begin));
    hn::StoreU(first, d, firsts + (row - k_begin));
    hn::StoreU(hn::Sub(end, first), d, counts + (row - k_begin));
  }
  const auto fall = hn::Mul(hn::BitCast(du, iota), hn::Set(du, face.fall_v));
  const auto in_lane = hn::ShiftLeftSame(hn::BitCast(du, iota), 4 * v);
  const auto all_fall = hn::Set(du, face.fall_v * static_cast<uint32_t>(lanes));
  const auto all_lane = hn::Set(du, static_cast<uint32_t>(lanes) << (4 * v));
  const auto err = hn::Set(du, face.err << (32 - kDepthBits));
  const auto size_a = hn::Set(du, static_cast<uint32_t>(size[a]));
  size_t placed = places.size;
  for (int32_t row = 0; row < k_end - k_begin; ++row) {
    int32_t count = counts[row];
    if (count <= 0) continue;
    auto depth = hn::Add(hn::Set(du, depths[row]), fall);
    auto at = hn::Add(hn::Set(du, at_first[row]), in_lane);
    for (int32_t done = 0;; done += lanes) {
      const auto above = hn::ShiftRight<kDepthBits>(depth);
      const auto inside = hn::RebindMask(du, hn::Lt(iota, hn::Set(d, count)));
      const auto close = hn::Lt(hn::ShiftLeft<32 - kDepthBits>(depth), err);
      if (HWY_UNLIKELY(!hn::AllFalse(du, hn::And(inside, close)))) {
        places.size = placed;
        PlaceExactly(face, k_begin + row, firsts[row] + done, std::min(count, lanes), from[a],
                     size[a],
                     at_first[row] + (static_cast<uint32_t>(done) << (4 * v)), places);
        placed = places.size;
      } else {
        const auto drawn = hn::And(inside, hn::Lt(above, size_a));
        const auto voxel = hn::Add(at, hn::ShiftLeftSame(above, 4 * a));
        // Not CompressStore, which some processors do word by word.
        hn::StoreU(hn::Compress(voxel, drawn), du, places.at + placed);
        placed += hn::CountTrue(du, drawn);
      }
      count -= lanes;
      if (HWY_LIKELY(count <= 0)) break;
      depth = hn::Add(depth, all_fall);
      at = hn::Add(at, all_lane);
    }
  }
  places.size = placed;
}

HWY_ATTR HWY_INLINE void PlaceSingles(const TriangleRuns& face, const int32_t from[3],
                                      const int32_t size[3], FacePlaces& places) {
  const DW d;
  // Eight bits an axis, 64 too many so that none is negative: in the tile from 64 to 79.
  uint32_t base = 0, short_by = 0;
  for (int r = 0; r < 3; ++r) {
    base += static_cast<uint32_t>(64 - from[r]) << (8 * r);
    short_by += static_cast<uint32_t>(kTileSize - size[r]) << (8 * r);
  }
  const VW to_tile = hn::Set(d, base), to_end = hn::Set(d, short_by);
  const VW in_tile = hn::Set(d, 0x404040), outside = hn::Set(d, 0xF0F0F0), zero = hn::Zero(d);
  const VW x = hn::Set(d, 0xF), y = hn::Set(d, 0xF0), z = hn::Set(d, 0xF00);
  const VW count = hn::Set(d, static_cast<uint32_t>(face.singles)), iota = hn::Iota(d, 0);
  const uint32_t* const voxels = face.voxels();
  size_t placed = places.size;
  for (uint32_t i = 0; i < face.singles; i += static_cast<uint32_t>(hn::Lanes(d))) {
    const VW voxel = hn::Add(hn::LoadU(d, voxels + i), to_tile);
    const VW beyond = hn::Or(hn::Xor(voxel, in_tile), hn::Xor(hn::Add(voxel, to_end), in_tile));
    const auto drawn = hn::And(hn::Eq(hn::And(beyond, outside), zero),
                               hn::Lt(hn::Add(hn::Set(d, i), iota), count));
    const VW at = hn::Or(hn::And(voxel, x), hn::Or(hn::And(hn::ShiftRight<4>(voxel), y),
                                                   hn::And(hn::ShiftRight<8>(voxel), z)));
    hn::StoreU(hn::Compress(at, drawn), d, places.at + placed);
    placed += hn::CountTrue(d, drawn);
  }
  places.size = placed;
}

HWY_ATTR inline void DrawTrianglesIn(const TriangleMemory* parts, std::span<const BinItem> items,
                                     const int32_t* lo, const int32_t* hi, uint32_t* words,
                                     TileRows& touched) {
  constexpr size_t kAhead = 8, kFew = 16;
  FacePlaces places;
  const int32_t size[3] = {hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]};
  const bool few = items.size() <= kFew;
  if (!few) touched = TileRows::All();
  for (size_t i = 0; i < items.size(); ++i) {
    if (i + kAhead < items.size() && items[i + kAhead].count() != 0) {
      const BinItem& next = items[i + kAhead];
      const TriangleRuns* const face = parts[next.first()].units.data() + next.item;
      hwy::Prefetch(face);
      hwy::Prefetch(face + 1);
      hwy::Prefetch(face + 2);
    }
    const BinItem& item = items[i];
    if (item.count() == 0) continue;
    const TriangleRuns& face = parts[item.first()].units.data()[item.item];
    int32_t from[3];
    for (int r = 0; r < 3; ++r) from[r] = lo[r] - face.origin[r];
    places.size = 0;
    PlaceFace(face, from, size, places);
    PlaceSingles(face, from, size, places);
    RaisePlaces(places, face.word, words);
    if (few) {
      for (size_t p = 0; p < places.size; ++p) touched.Add(places.at[p]);
    }
  }
}

inline const char* TriangleTargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
