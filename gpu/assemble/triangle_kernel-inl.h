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

// Places in a tile, those of each face one behind the other, before they are raised: in groups of four with a word each.
struct FacePlaces {
  static constexpr size_t kGroup = 4;
  static constexpr size_t kFull = 512;
  static constexpr size_t kMostOfFace = kTileSize * kTileSize + 3;
  static constexpr size_t kSize = kFull + kMostOfFace + 64;

  HWY_ALIGN uint32_t at[kSize];
  HWY_ALIGN uint32_t words[kSize / kGroup];
  size_t size = 0;

  // Ends a face, of which the places from `begin` on are: with its last one again, up to a whole group.
  HWY_ATTR HWY_INLINE void EndFace(size_t begin, uint32_t word) {
    if (size == begin) return;
    const DW d;
    const hn::CappedTag<uint32_t, kGroup> group;
    const size_t groups = (size + kGroup - 1) / kGroup;
    const auto last = hn::Set(group, at[size - 1]);
    for (size_t i = 0; i < kGroup; i += hn::Lanes(group)) hn::StoreU(last, group, at + size + i);
    const VW all = hn::Set(d, word);
    size_t i = begin / kGroup;
    do {
      hn::StoreU(all, d, words + i);
      i += hn::Lanes(d);
    } while (i < groups);
    size = groups * kGroup;
  }
};

HWY_ATTR HWY_INLINE void RaisePlaces(FacePlaces& places, uint32_t* words) {
  const hn::CappedTag<uint32_t, 1> d;  // without a branch that nobody could foresee
  for (size_t i = 0; i < places.size; i += FacePlaces::kGroup) {
    const auto word = hn::Set(d, places.words[i / FacePlaces::kGroup]);
    for (size_t j = i; j < i + FacePlaces::kGroup; ++j) {
      uint32_t* const at = words + places.at[j];
      hn::StoreU(hn::Max(hn::LoadU(d, at), word), d, at);
    }
  }
  places.size = 0;
}

// The columns of row k of a face, in the tile that begins at voxel `from`, by the definition's division.
HWY_NOINLINE inline void PlaceExactly(const TriangleRuns& face, int32_t k, uint32_t columns,
                                      const int32_t from[3], const int32_t size[3],
                                      FacePlaces& places) {
  const ExactDepth& exact = face.exact();
  const int64_t divisor = int64_t{exact.divisor} * 256;
  for (; columns != 0; columns &= columns - 1) {
    const int column = std::countr_zero(columns);
    const int64_t numerator = exact.numerator + int64_t{exact.step_u} * 256 * k +
                              int64_t{exact.step_v} * 256 * (from[face.v] + column);
    const int64_t above = FloorDiv(numerator, divisor) - from[face.a];
    if (above < 0 || above >= size[face.a]) continue;
    places.at[places.size++] =
        static_cast<uint32_t>((k - from[face.u]) << (4 * face.u) | column << (4 * face.v) |
                              static_cast<int>(above) << (4 * face.a));
  }
}

// What of a face lies in the tile that begins at voxel `from`, counted from the face's origin, and has `size` voxels.
HWY_ATTR HWY_INLINE void PlaceFace(const TriangleRuns& face, BinItem item, const int32_t from[3],
                                   const int32_t size[3], FacePlaces& places) {
  const DW d;
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  const int a = face.a, u = face.u, v = face.v;
  const auto row = static_cast<int32_t>(item.row());
  const int32_t begin = from[u] + row,
                end = from[u] + std::min(size[u], row + static_cast<int32_t>(item.rows()));
  const uint16_t* const columns =
      face.columns((from[v] + (face.origin[v] & (kTileSize - 1))) >> kTileBits);
  const uint32_t in_volume = (uint32_t{1} << size[v]) - 1;
  const VW iota = hn::Iota(d, 0);
  const VW fall_u = hn::Set(d, face.fall_u), row_step = hn::Set(d, uint32_t{1} << (4 * u));
  const VW err = hn::Set(d, face.err << (32 - kDepthBits));
  const VW size_a = hn::Set(d, static_cast<uint32_t>(size[a]));
  for (int32_t lane = 0; lane < kTileSize; lane += lanes) {
    const size_t first = places.size;
    size_t placed = first;
    VW depth = hn::Add(hn::Set(d, face.depth - (static_cast<uint32_t>(from[a]) << kDepthBits) +
                                      static_cast<uint32_t>(begin) * face.fall_u +
                                      static_cast<uint32_t>(from[v] + lane) * face.fall_v),
                       hn::Mul(iota, hn::Set(d, face.fall_v)));
    VW at = hn::Add(hn::Set(d, static_cast<uint32_t>(row << (4 * u) | lane << (4 * v))),
                    hn::ShiftLeftSame(iota, 4 * v));
    auto unsure = hn::MaskFromVec(hn::Zero(d));
    for (int32_t k = begin; k < end; ++k) {
      const uint64_t bits = (columns[k] & in_volume) >> lane;
      const auto inside = hn::LoadMaskBits(d, reinterpret_cast<const uint8_t*>(&bits));
      const VW above = hn::ShiftRight<kDepthBits>(depth);
      const auto close = hn::Lt(hn::ShiftLeft<32 - kDepthBits>(depth), err);
      unsure = hn::Or(unsure, hn::And(inside, close));
      const auto drawn = hn::And(inside, hn::Lt(above, size_a));
      // Not CompressStore, which some processors do word by word.
      hn::StoreU(hn::Compress(hn::Add(at, hn::ShiftLeftSame(above, 4 * a)), drawn), d,
                 places.at + placed);
      placed += hn::CountTrue(d, drawn);
      depth = hn::Add(depth, fall_u);
      at = hn::Add(at, row_step);
    }
    places.size = placed;
    if (HWY_LIKELY(hn::AllFalse(d, unsure))) continue;
    places.size = first;
    for (int32_t k = begin; k < end; ++k) {
      const uint32_t there = ((uint32_t{1} << lanes) - 1) << lane & in_volume;
      PlaceExactly(face, k, columns[k] & there, from, size, places);
    }
  }
}

HWY_ATTR HWY_INLINE void PlaceVertices(const TriangleRuns& face, const int32_t from[3],
                                       const int32_t size[3], FacePlaces& places) {
  const hn::CappedTag<uint32_t, 4> d;
  // Eight bits an axis, 64 too many so that none is negative: in the tile from 64 to 79.
  uint32_t base = 0, short_by = 0;
  for (int r = 0; r < 3; ++r) {
    base += static_cast<uint32_t>(64 - from[r]) << (8 * r);
    short_by += static_cast<uint32_t>(kTileSize - size[r]) << (8 * r);
  }
  const auto in_tile = hn::Set(d, 0x404040);
  for (size_t i = 0; i < 4; i += hn::Lanes(d)) {
    const auto voxel = hn::Add(hn::LoadU(d, face.vertices + i), hn::Set(d, base));
    const auto beyond =
        hn::Or(hn::Xor(voxel, in_tile), hn::Xor(hn::Add(voxel, hn::Set(d, short_by)), in_tile));
    const auto drawn = hn::Eq(hn::And(beyond, hn::Set(d, 0xF0F0F0)), hn::Zero(d));
    const auto at = hn::Or(hn::And(voxel, hn::Set(d, 0xF)),
                           hn::Or(hn::And(hn::ShiftRight<4>(voxel), hn::Set(d, 0xF0)),
                                  hn::And(hn::ShiftRight<8>(voxel), hn::Set(d, 0xF00))));
    hn::StoreU(hn::Compress(at, drawn), d, places.at + places.size);
    places.size += hn::CountTrue(d, drawn);
  }
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
      const TriangleRuns* const face = parts[next.part()].units.data() + next.item;
      hwy::Prefetch(face);
      hwy::Prefetch(face + 1);
      hwy::Prefetch(face + 2);
    }
    const BinItem& item = items[i];
    if (item.count() == 0) continue;
    const TriangleRuns& face = parts[item.part()].units.data()[item.item];
    int32_t from[3];
    for (int r = 0; r < 3; ++r) from[r] = lo[r] - face.origin[r];
    const size_t begin = places.size;
    PlaceFace(face, item, from, size, places);
    PlaceVertices(face, from, size, places);
    if (few) {
      for (size_t p = begin; p < places.size; ++p) touched.Add(places.at[p]);
    }
    places.EndFace(begin, face.word);
    if (places.size >= FacePlaces::kFull) RaisePlaces(places, words);
  }
  RaisePlaces(places, words);
}

inline const char* TriangleTargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
