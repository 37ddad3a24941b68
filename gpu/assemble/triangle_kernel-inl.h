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

// What of a face may lie in a tile, before it is placed: worked out for several items at once, so that none of them waits for
// another's.
struct FaceInTile {
  const TriangleRuns* face;
  const uint32_t* rows;  // in the tile
  int32_t row, count;    // of them the first, counted from the tile's
  int32_t from[3];       // the tile's first voxel, from the face's origin, by role
  uint32_t depth, fall_u, fall_v,
      err;                 // from the tile on, at the first row and the tile's first column
  uint32_t at, row_step;   // in the tile, of the first row and of each
  uint32_t right, left;    // shifts of columns to the tile's first
  uint32_t to_a, along_a;  // shift of depths and their place
  uint32_t axis_v, word;
  uint32_t vertex_base;  // makes 64 of the tile's first voxel, eight bits an axis

  HWY_INLINE void Set(const TriangleRuns& of, BinItem item, const int32_t* lo,
                      const int32_t* size) {
    face = &of;
    const int a = of.axis(0), u = of.axis(1), v = of.axis(2);
    from[0] = lo[a] - of.origin[0];
    from[1] = lo[u] - of.origin[1];
    from[2] = lo[v] - of.origin[2];
    row = static_cast<int32_t>(item.row());
    count = std::min(static_cast<int32_t>(item.rows()), size[u] - row);
    rows = of.rows() + from[1] + row;
    fall_u = of.fall_u;
    fall_v = of.fall_v;
    err = of.err << (32 - kDepthBits);
    depth = of.depth - (static_cast<uint32_t>(from[0]) << kDepthBits) +
            static_cast<uint32_t>(from[1] + row) * fall_u + static_cast<uint32_t>(from[2]) * fall_v;
    at = static_cast<uint32_t>(row) << (4 * u);
    row_step = uint32_t{1} << (4 * u);
    // Of faces with more columns than bits another way is taken.
    right = static_cast<uint32_t>(std::max(from[2], 0)) & 31;
    left = static_cast<uint32_t>(std::max(-from[2], 0));
    to_a = kDepthBits - 4 * static_cast<uint32_t>(a);
    along_a = uint32_t{0xF} << (4 * a);
    axis_v = static_cast<uint32_t>(v);
    word = of.word;
    vertex_base = static_cast<uint32_t>(64 - from[0]) << (8 * a) |
                  static_cast<uint32_t>(64 - from[1]) << (8 * u) |
                  static_cast<uint32_t>(64 - from[2]) << (8 * v);
  }
};

// Of a tile by axis: how much of it the volume has, and what follows from that.
struct TileSize {
  uint32_t voxels[3];
  uint32_t vertex_short = 0;  // of sixteen voxels, eight bits an axis

  TileSize(const int32_t* lo, const int32_t* hi) {
    for (int r = 0; r < 3; ++r) {
      voxels[r] = static_cast<uint32_t>(hi[r] - lo[r]);
      vertex_short |= (kTileSize - voxels[r]) << (8 * r);
    }
  }
};

// The columns of a row, by the definition's division.
HWY_NOINLINE inline void PlaceExactly(const FaceInTile& in, int32_t row, uint32_t columns,
                                      uint32_t size_a, FacePlaces& places) {
  const TriangleRuns& face = *in.face;
  const ExactDepths& exact = face.exact();
  const uint32_t lane = face.exact_lane;
  const int64_t divisor = int64_t{exact.divisor[lane]} * 256;
  const int a = face.axis(0), u = face.axis(1), v = face.axis(2);
  for (; columns != 0; columns &= columns - 1) {
    const int column = std::countr_zero(columns);
    const int64_t numerator = static_cast<int64_t>(exact.numerator[lane]) +
                              int64_t{exact.step_u[lane]} * 256 * (in.from[1] + row) +
                              int64_t{exact.step_v[lane]} * 256 * (in.from[2] + column);
    const int64_t above = FloorDiv(numerator, divisor) - in.from[0];
    if (above < 0 || above >= size_a) continue;
    places.at[places.size++] = static_cast<uint32_t>(row << (4 * u) | column << (4 * v) |
                                                     static_cast<int>(above) << (4 * a));
  }
}

// The columns of sixteen rows that lie in the tile.
struct RowWindows {
  HWY_ALIGN uint16_t at[kTileSize];

  // `wanted`: which columns are.
  HWY_ATTR HWY_INLINE void Set(const FaceInTile& in, uint32_t wanted) {
    const uint32_t more = in.face->more;
    if (HWY_UNLIKELY(more != 0)) {
      for (int32_t k = 0; k < kTileSize; ++k) {
        const uint64_t bits = uint64_t{in.rows[more + static_cast<uint32_t>(k)]} << 32 | in.rows[k];
        const uint64_t there = in.from[2] < 0 ? bits << -in.from[2] : bits >> in.from[2];
        at[k] = k < in.count ? static_cast<uint16_t>(there & wanted) : uint16_t{0};
      }
      return;
    }
    const DW d;
    const hn::Rebind<uint16_t, DW> d16;
    const VW right = hn::Set(d, in.right), left = hn::Set(d, in.left), mask = hn::Set(d, wanted);
    const VW count = hn::Set(d, static_cast<uint32_t>(in.count)), iota = hn::Iota(d, 0);
    for (size_t k = 0; k < kTileSize; k += hn::Lanes(d)) {
      const VW bits = hn::And(hn::Shl(hn::Shr(hn::LoadU(d, in.rows + k), right), left), mask);
      const auto some = hn::Lt(hn::Add(iota, hn::Set(d, static_cast<uint32_t>(k))), count);
      hn::Store(hn::TruncateTo(d16, hn::IfThenElseZero(some, bits)), d16, at + k);
    }
  }
};

HWY_ATTR HWY_INLINE void PlaceFace(const FaceInTile& in, const TileSize& size, FacePlaces& places) {
  const DW d;
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  alignas(64) static constexpr uint32_t kColumns[3][kTileSize] = {
      {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15},
      {0x00, 0x10, 0x20, 0x30, 0x40, 0x50, 0x60, 0x70, 0x80, 0x90, 0xA0, 0xB0, 0xC0, 0xD0, 0xE0,
       0xF0},
      {0x000, 0x100, 0x200, 0x300, 0x400, 0x500, 0x600, 0x700, 0x800, 0x900, 0xA00, 0xB00, 0xC00,
       0xD00, 0xE00, 0xF00}};
  RowWindows windows;
  windows.Set(in, (uint32_t{1} << size.voxels[in.axis_v]) - 1);
  const uint32_t size_a = size.voxels[in.face->axis(0)];
  const VW fall_u = hn::Set(d, in.fall_u), fall_v = hn::Set(d, in.fall_v);
  const VW row_step = hn::Set(d, in.row_step), end_a = hn::Set(d, size_a << kDepthBits);
  const VW to_a = hn::Set(d, in.to_a), along_a = hn::Set(d, in.along_a);
  for (int32_t lane = 0; lane < kTileSize; lane += lanes) {
    const size_t first = places.size;
    size_t placed = first;
    VW depth =
        hn::Add(hn::Set(d, in.depth),
                hn::Mul(hn::Add(hn::Iota(d, 0), hn::Set(d, static_cast<uint32_t>(lane))), fall_v));
    VW at = hn::Add(hn::Set(d, in.at), hn::Load(d, kColumns[in.axis_v] + lane));
    // The least fraction of a depth; there may be lower ones than those of columns, seldom.
    VW fraction = hn::Set(d, ~uint32_t{0});
    const auto place = [&](int32_t k) HWY_ATTR {
      const uint64_t bits = uint64_t{windows.at[k]} >> lane;
      const auto inside = hn::LoadMaskBits(d, reinterpret_cast<const uint8_t*>(&bits));
      const auto drawn = hn::And(inside, hn::Lt(depth, end_a));
      // Not CompressStore, which some processors do word by word.
      hn::StoreU(hn::Compress(hn::OrAnd(at, hn::Shr(depth, to_a), along_a), drawn), d,
                 places.at + placed);
      placed += hn::CountTrue(d, drawn);
      fraction = hn::Min(fraction, hn::ShiftLeft<32 - kDepthBits>(depth));
      depth = hn::Add(depth, fall_u);
      at = hn::Add(at, row_step);
    };
    // By fours, since nobody could foresee how many there are.
    for (int32_t k = 0; k < in.count; k += 4) {
      place(k);
      place(k + 1);
      place(k + 2);
      place(k + 3);
    }
    places.size = placed;
    if (HWY_LIKELY(hn::AllFalse(d, hn::Lt(fraction, hn::Set(d, in.err))))) continue;
    places.size = first;
    const uint32_t there = ((uint32_t{1} << lanes) - 1) << lane;
    for (int32_t k = 0; k < in.count; ++k) {
      PlaceExactly(in, in.row + k, windows.at[k] & there, size_a, places);
    }
  }
}

HWY_ATTR HWY_INLINE void PlaceVertices(const FaceInTile& in, const TileSize& size,
                                       FacePlaces& places) {
  const hn::CappedTag<uint32_t, 4> d;
  // Eight bits an axis, 64 too many so that none is negative: in the tile from 64 to 79.
  const auto in_tile = hn::Set(d, 0x404040), base = hn::Set(d, in.vertex_base);
  const auto short_by = hn::Set(d, size.vertex_short);
  // The fourth, of axes, is none.
  for (size_t i = 0; i < 4; i += hn::Lanes(d)) {
    const auto voxel = hn::Add(hn::LoadU(d, in.face->vertices + i), base);
    const auto beyond = hn::Or(hn::Xor(voxel, in_tile), hn::Xor(hn::Add(voxel, short_by), in_tile));
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
  constexpr size_t kBlock = 8, kAhead = 32, kFew = 16;
  FacePlaces places;
  FaceInTile block[2][kBlock];
  size_t next = 0;
  const int32_t voxels[3] = {hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]};
  const TileSize size(lo, hi);
  const bool few = items.size() <= kFew;
  if (!few) touched = TileRows::All();
  const auto face_of = [&](const BinItem& item) -> const TriangleRuns& {
    return parts[item.part()].units.data()[item.item];
  };
  const auto set_block = [&](FaceInTile* to) {
    size_t count = 0;
    for (; next < items.size() && count < kBlock; ++next) {
      if (next + kAhead < items.size() && items[next + kAhead].count() != 0) {
        hwy::Prefetch(&face_of(items[next + kAhead]));
      }
      if (items[next].count() == 0) continue;
      FaceInTile& in = to[count++];
      in.Set(face_of(items[next]), items[next], lo, voxels);
      hwy::Prefetch(in.rows);
      hwy::Prefetch(in.rows + kTileSize - 1);
    }
    return count;
  };
  size_t count = set_block(block[0]);
  for (size_t turn = 0; count != 0; turn ^= 1) {
    // While rows of these come, those are drawn.
    const size_t count_after = set_block(block[turn ^ 1]);
    for (const FaceInTile& in : std::span(block[turn], count)) {
      const size_t first = places.size;
      PlaceFace(in, size, places);
      PlaceVertices(in, size, places);
      if (few) {
        for (size_t p = first; p < places.size; ++p) touched.Add(places.at[p]);
      }
      places.EndFace(first, in.word);
      if (places.size >= FacePlaces::kFull) RaisePlaces(places, words);
    }
    count = count_after;
  }
  RaisePlaces(places, words);
}

inline const char* TriangleTargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
