// What triangle_kernel.cc calls, once for each instruction set.
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

// Part of a tile, in voxels relative to a triangle's first, and where that lies in the tile (mod 16).
struct TrianglePart {
  int32_t lo[3], hi[3], base[3];

  // False if nothing of the triangle can be in the tile.
  HWY_INLINE bool Set(const SmallTriangle& t, const int32_t tile_lo[3], const int32_t tile_hi[3]) {
    bool some = true;
    for (int r = 0; r < 3; ++r) {
      lo[r] = std::max<int32_t>(t.lo[r], tile_lo[r] - t.origin[r]);
      hi[r] = std::min<int32_t>(t.hi[r], tile_hi[r] - t.origin[r]);
      base[r] = t.origin[r] - tile_lo[r];
      some &= lo[r] < hi[r];
    }
    return some;
  }
  HWY_INLINE uint32_t At(const int32_t voxel[3]) const {
    return static_cast<uint32_t>((voxel[0] + base[0]) | (voxel[1] + base[1]) << 4 |
                                 (voxel[2] + base[2]) << 8);
  }
};

// What the columns along an axis come to, at the part's first one; changes to the next column and to the next row.
struct TriangleColumns {
  int32_t edge[3], edge_lane[3], edge_row[3];  // inside: all ≥ 0
  int64_t depth, depth_row;                    // times |n_a|
  double depth_lane;
  double inverse;  // of `den`, |n_a| voxels
  int32_t width, height;

  // False if no column of the part meets the triangle within the part.
  HWY_INLINE bool Set(const SmallTriangle& t, const TrianglePart& part, int a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    const int32_t sign = t.n[a] < 0 ? -1 : 1;
    width = part.hi[b] - part.lo[b];
    height = part.hi[c] - part.lo[c];
    const int32_t qb = part.lo[b] * 256 + 128, qc = part.lo[c] * 256 + 128;
    int32_t outside = 0;
    for (int i = 0; i < 3; ++i) {
      const int j = i == 2 ? 0 : i + 1;
      const int32_t db = (t.p[j][b] - t.p[i][b]) * sign, dc = (t.p[j][c] - t.p[i][c]) * sign;
      edge[i] = db * (qc - t.p[i][c]) - dc * (qb - t.p[i][b]);
      edge_lane[i] = -dc * 256;
      edge_row[i] = db * 256;
      outside |= edge[i] + std::max(0, edge_lane[i] * (width - 1)) +
                 std::max(0, edge_row[i] * (height - 1));
    }
    if (outside < 0) return false;
    const int64_t na = int64_t{t.n[a]} * sign, nb = int64_t{t.n[b]} * sign,
                  nc = int64_t{t.n[c]} * sign;
    depth = na * t.p[0][a] - nb * (qb - t.p[0][b]) - nc * (qc - t.p[0][c]);
    depth_row = -nc * 256;
    const int64_t lane = -nb * 256, den = na * 256;
    depth_lane = static_cast<double>(lane);
    const int64_t lanes = lane * (width - 1), rows = depth_row * (height - 1);
    const int64_t least = depth + std::min<int64_t>(0, lanes) + std::min<int64_t>(0, rows);
    const int64_t most = depth + std::max<int64_t>(0, lanes) + std::max<int64_t>(0, rows);
    if (most < part.lo[a] * den || least >= part.hi[a] * den) return false;
    inverse = 1.0 / static_cast<double>(den);
    return true;
  }
};

HWY_INLINE size_t AddVertices(const SmallTriangle& t, const TrianglePart& part, DrawBlock& block,
                              size_t size) {
  for (const int16_t(&p)[3] : t.p) {
    int32_t voxel[3];
    bool inside = true;
    for (int r = 0; r < 3; ++r) {
      voxel[r] = p[r] >> 8;
      inside &= voxel[r] >= part.lo[r] && voxel[r] < part.hi[r];
    }
    block.at[size] = part.At(voxel) & (kTileVoxels - 1);
    block.words[size] = t.word;
    size += inside;
  }
  return size;
}

#if HWY_TARGET == HWY_SCALAR

inline void DrawTrianglesIn(const SmallTriangle* triangles, std::span<const BinItem> items,
                            const int32_t* lo, const int32_t* hi, uint32_t* words,
                            TileRows& touched) {
  touched = TileRows::All();
  DrawBlock block;
  for (const BinItem& item : items) {
    const SmallTriangle& t = triangles[item.item];
    TrianglePart part;
    if (item.count() == 0 || !part.Set(t, lo, hi)) continue;
    RaiseBlock(block, AddVertices(t, part, block, 0), words);
    for (int a = 0; a < 3; ++a) {
      TriangleColumns columns;
      if (t.n[a] == 0 || !columns.Set(t, part, a)) continue;
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      const int64_t den = (t.n[a] < 0 ? -int64_t{t.n[a]} : int64_t{t.n[a]}) * 256;
      int32_t voxel[3];
      for (int32_t row = 0; row < columns.height; ++row) {
        voxel[c] = part.lo[c] + row;
        for (int32_t lane = 0; lane < columns.width; ++lane) {
          voxel[b] = part.lo[b] + lane;
          int32_t outside = 0;
          for (int i = 0; i < 3; ++i) {
            outside |= columns.edge[i] + columns.edge_row[i] * row + columns.edge_lane[i] * lane;
          }
          const int64_t depth = columns.depth + columns.depth_row * row +
                                static_cast<int64_t>(columns.depth_lane) * lane;
          voxel[a] = static_cast<int32_t>(FloorDiv(depth, den));
          if (outside < 0 || voxel[a] < part.lo[a] || voxel[a] >= part.hi[a]) continue;
          uint32_t& at = words[part.At(voxel)];
          at = std::max(at, t.word);
        }
      }
    }
  }
}

#else

// Columns along axis kAxis, as many rows at once as have room in a vector. `several`: a block was drawn.
template <int kAxis>
HWY_ATTR HWY_INLINE size_t DrawColumns(const SmallTriangle& t, const TrianglePart& part,
                                       DrawBlock& block, size_t size, bool& several,
                                       uint32_t* words) {
  constexpr int kB = (kAxis + 1) % 3, kC = (kAxis + 2) % 3;
  TriangleColumns columns;
  if (!columns.Set(t, part, kAxis)) return size;
  const DW d;
  const hn::RebindToSigned<DW> di;
  const hn::Half<decltype(di)> half;
  const hn::Rebind<double, decltype(half)> df;
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  // Lane i: column i mod `across`, row i / `across`.
  int bits = std::countr_zero(static_cast<uint32_t>(lanes));
  while (bits > 0 && columns.width <= 1 << (bits - 1)) --bits;
  const int32_t across = 1 << bits, rows = lanes >> bits;
  const auto iota = hn::Iota(di, 0);
  const auto column = hn::And(iota, hn::Set(di, across - 1));
  const auto row_of = hn::ShiftRightSame(iota, bits);
  const auto spread = [&](int i) HWY_ATTR {
    return hn::Add(hn::Mul(column, hn::Set(di, columns.edge_lane[i])),
                   hn::Mul(row_of, hn::Set(di, columns.edge_row[i])));
  };
  const auto slope0 = spread(0), slope1 = spread(1), slope2 = spread(2);
  const auto lane_fall = hn::Set(df, columns.depth_lane * columns.inverse);
  const auto row_fall = hn::Set(df, static_cast<double>(columns.depth_row) * columns.inverse);
  const auto fall = [&](auto column_part, auto row_part) HWY_ATTR {
    return hn::Add(hn::Mul(hn::PromoteTo(df, column_part), lane_fall),
                   hn::Mul(hn::PromoteTo(df, row_part), row_fall));
  };
  const auto fall_low = fall(hn::LowerHalf(half, column), hn::LowerHalf(half, row_of));
  const auto fall_high = fall(hn::UpperHalf(half, column), hn::UpperHalf(half, row_of));
  const auto first = hn::Set(di, part.lo[kAxis]);
  const auto count = hn::Set(d, static_cast<uint32_t>(part.hi[kAxis] - part.lo[kAxis]));
  const auto in_lane =
      hn::BitCast(d, hn::Or(hn::ShiftLeft<4 * kB>(column), hn::ShiftLeft<4 * kC>(row_of)));
  const VW word = hn::Set(d, t.word);
  const auto minus_one = hn::Set(di, -1);
  int32_t at_first[3];
  at_first[kAxis] = part.lo[kAxis];
  for (int32_t lane = 0; lane < columns.width; lane += across) {
    const auto exists = hn::Lt(column, hn::Set(di, columns.width - lane));
    at_first[kB] = part.lo[kB] + lane;
    int32_t edge[3];
    for (int i = 0; i < 3; ++i) edge[i] = columns.edge[i] + columns.edge_lane[i] * lane;
    int64_t depth = columns.depth + static_cast<int64_t>(columns.depth_lane) * lane;
    for (int32_t row = 0; row < columns.height; row += rows) {
      const auto outside = hn::Or(
          hn::Or(hn::Add(hn::Set(di, edge[0]), slope0), hn::Add(hn::Set(di, edge[1]), slope1)),
          hn::Add(hn::Set(di, edge[2]), slope2));
      const auto inside =
          hn::And(hn::And(exists, hn::Lt(row_of, hn::Set(di, columns.height - row))),
                  hn::Gt(outside, minus_one));
      // Worked out where none is inside, too: a branch could not be foreseen.
      const auto q = hn::Set(df, (static_cast<double>(depth) + 0.5) * columns.inverse);
      const auto voxel = hn::Combine(di, hn::DemoteTo(half, hn::Floor(hn::Add(q, fall_high))),
                                     hn::DemoteTo(half, hn::Floor(hn::Add(q, fall_low))));
      const auto above = hn::BitCast(d, hn::Sub(voxel, first));
      const auto drawn = hn::And(hn::RebindMask(d, inside), hn::Lt(above, count));
      at_first[kC] = part.lo[kC] + row;
      const auto at =
          hn::Add(hn::Set(d, part.At(at_first)), hn::Add(in_lane, hn::ShiftLeft<4 * kAxis>(above)));
      hn::StoreU(word, d, block.words + size);
      // Not CompressStore, which some processors do word by word.
      hn::StoreU(hn::Compress(at, drawn), d, block.at + size);
      size += hn::CountTrue(d, drawn);
      if (size >= DrawBlock::kSize) {
        RaiseBlock(block, size, words);
        size = 0;
        several = true;
      }
      for (int i = 0; i < 3; ++i) edge[i] += columns.edge_row[i] * rows;
      depth += columns.depth_row * rows;
    }
  }
  return size;
}

HWY_ATTR inline void DrawTrianglesIn(const SmallTriangle* triangles, std::span<const BinItem> items,
                                     const int32_t* lo, const int32_t* hi, uint32_t* words,
                                     TileRows& touched) {
  constexpr size_t kAhead = 8;
  DrawBlock block;
  size_t size = 0;
  bool several = false;
  for (size_t i = 0; i < items.size(); ++i) {
    if (i + kAhead < items.size()) hwy::Prefetch(triangles + items[i + kAhead].item);
    const SmallTriangle& t = triangles[items[i].item];
    TrianglePart part;
    if (items[i].count() == 0 || !part.Set(t, lo, hi)) continue;
    // Triangles may have nothing but their vertices.
    if (size >= DrawBlock::kSize) {
      RaiseBlock(block, size, words);
      size = 0;
      several = true;
    }
    size = AddVertices(t, part, block, size);
    if (t.n[0] != 0) size = DrawColumns<0>(t, part, block, size, several, words);
    if (t.n[1] != 0) size = DrawColumns<1>(t, part, block, size, several, words);
    if (t.n[2] != 0) size = DrawColumns<2>(t, part, block, size, several, words);
  }
  RaiseLast(block, size, several, words, touched);
}

#endif

inline const char* TriangleTargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
