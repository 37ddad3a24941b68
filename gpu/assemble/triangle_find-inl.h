// How triangle_kernel.cc makes runs of small triangles (triangle_runs.h), once for each instruction set.
#if defined(VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_
#undef VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_
#endif

#include "gpu/assemble/draw_block-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

using DS = hn::RebindToSigned<DW>;
using VS = hn::Vec<DS>;
using DH = hn::Rebind<uint16_t, DW>;

constexpr int kMostTiles = 5;
constexpr int kVectorRoom = 16;

// Bit i: lane i. What is stored is loaded in the same size, so that it need not wait for the cache.
HWY_ATTR HWY_INLINE uint32_t BitsOf(hn::Mask<DS> mask) {
  const DS d;
  constexpr size_t kLanes = hn::MaxLanes(DS());
  if constexpr (kLanes > 8) {
    uint16_t bits;
    hn::StoreMaskBits(d, mask, reinterpret_cast<uint8_t*>(&bits));
    return bits;
  } else {
    uint8_t bits;
    hn::StoreMaskBits(d, mask, &bits);
    return bits & ((1u << kLanes) - 1);
  }
}

// x · 2^shift / divisor rounded up, where that is below 2³⁴ and the product below 2⁶³; adds `weight` to `err` if it was
// rounded.
HWY_INLINE uint32_t CeilFixed(int64_t x, int shift, int32_t divisor, double inverse,
                              uint32_t weight, uint32_t* err) {
  const int64_t scaled = x * (int64_t{1} << shift);
  // Less than 1 + 2⁻¹⁰ from the quotient.
  const auto q = static_cast<int64_t>(static_cast<double>(scaled) * inverse);
  const int64_t rest = scaled - q * divisor;
  const int64_t up = int64_t{rest > 0} + int64_t{rest > divisor} - int64_t{rest <= -divisor};
  *err += rest != up * divisor ? weight : 0;
  return static_cast<uint32_t>(q + up);
}

using DQ = hn::CappedTag<int32_t, 4>;

// Twice the signed areas of edges and voxel (k, j) in a projection: base + k·by_k + j·by_j; inside of all three ≥ 0.
struct EdgeFunctions {
  HWY_ALIGN int32_t base[4], by_k[4], by_j[4];

  HWY_ATTR HWY_INLINE void Set(const SmallTriangle& t, int along, int k, int j) {
    const DQ d;
    const bool cyclic = j == (along + 1) % 3;
    const auto sign = hn::Set(d, (t.n[along] < 0) == cyclic ? -1 : 1);  // of the area in (j, k)
    const auto centre = hn::Set(d, 128);
    for (size_t i = 0; i < 4; i += hn::Lanes(d)) {
      // The fourth is of no use; behind the vertices lies the normal.
      const auto pj = hn::LoadU(d, t.p[j] + i), pk = hn::LoadU(d, t.p[k] + i);
      const auto dj = hn::Mul(hn::Sub(hn::LoadU(d, t.p[j] + i + 1), pj), sign);
      const auto dk = hn::Mul(hn::Sub(hn::LoadU(d, t.p[k] + i + 1), pk), sign);
      hn::Store(hn::Sub(hn::Mul(dj, hn::Sub(centre, pk)), hn::Mul(dk, hn::Sub(centre, pj))), d,
                base + i);
      hn::Store(hn::ShiftLeft<8>(dj), d, by_k + i);
      hn::Store(hn::Neg(hn::ShiftLeft<8>(dk)), d, by_j + i);
    }
  }
};

// For rows k the columns j inside all three edges: of each edge ⌊E/|slope|⌋ + 1 is where it ends a run, if it falls along j,
// and its negative where it begins one. The quotient's first guess is in single precision, off by less than one where it
// matters (beyond 2⁷ only its sign does); the remainder puts it right.
struct RunFinder {
  HWY_ALIGN int32_t base[4], by_k[4], slope[4], end_room[4], first_room[4];
  HWY_ALIGN float inverse[4];
  int32_t columns;

  HWY_ATTR HWY_INLINE void Set(const EdgeFunctions& edges, const int32_t* edges_by_k,
                               const int32_t* edges_by_j, int32_t column_count) {
    const DQ d;
    const hn::RebindToFloat<DQ> df;
    columns = column_count;
    const auto far = hn::Set(d, 1 << 20), one = hn::Set(d, 1), zero = hn::Zero(d);
    bool level = false;
    for (size_t i = 0; i < 4; i += hn::Lanes(d)) {
      const auto by_j = hn::Load(d, edges_by_j + i);
      const auto steep = hn::Abs(by_j);
      const auto rises = hn::Gt(by_j, zero);
      hn::Store(hn::Load(d, edges.base + i), d, base + i);
      hn::Store(hn::Load(d, edges_by_k + i), d, by_k + i);
      hn::Store(steep, d, slope + i);
      hn::Store(hn::IfThenElse(rises, far, one), d, end_room + i);
      hn::Store(hn::Neg(hn::IfThenElse(rises, zero, far)), d, first_room + i);
      hn::Store(hn::Div(hn::Set(df, 1.0f), hn::ConvertTo(df, steep)), df, inverse + i);
      level |= !hn::AllFalse(d, hn::Eq(steep, zero));
    }
    if (HWY_LIKELY(!level)) return;
    for (int i = 0; i < 3; ++i) {
      if (slope[i] != 0) continue;
      // A whole row is inside, or none of it: 2E + 1, of an edge one unit long, times 128.
      const int32_t length = (by_k[i] < 0 ? -by_k[i] : by_k[i]) / 256;
      base[i] = base[i] / length * 2 + 1;
      by_k[i] = by_k[i] / length * 2;
      inverse[i] = 128;
    }
  }

  // From 0 to `columns`; first ≥ end where there are none.
  HWY_ATTR HWY_INLINE void Find(VS k, VS& first, VS& end) const {
    const DS d;
    const hn::RebindToFloat<DS> df;
    const VS one = hn::Set(d, 1), zero = hn::Zero(d), most = hn::Set(d, columns);
    first = zero;
    end = most;
    for (int i = 0; i < 3; ++i) {
      const VS steep = hn::Set(d, slope[i]);
      const VS x = hn::Add(hn::Set(d, base[i]), hn::Mul(k, hn::Set(d, by_k[i])));
      VS q = hn::ConvertTo(d, hn::Mul(hn::ConvertTo(df, x), hn::Set(df, inverse[i])));
      const VS rest = hn::Sub(x, hn::Mul(q, steep));
      q = hn::Add(q, hn::ShiftRight<31>(rest));
      q = hn::Add(q, hn::AndNot(hn::VecFromMask(d, hn::Lt(rest, steep)), one));
      end = hn::Min(end, hn::Add(q, hn::Set(d, end_room[i])));
      first = hn::Max(first, hn::Sub(hn::Set(d, first_room[i]), q));
    }
    first = hn::Min(first, most);
    end = hn::Max(end, zero);
  }
};

// Whether lines along j's axis light voxels that lie in the columns (k, j) of a face.
struct LineTest {
  EdgeFunctions edges;  // of the projection along j's axis, over k and the voxels of axis a
  uint32_t depth, fall_k, fall_j, err;
  int64_t numerator, step_k, step_j, divisor;  // the exact depth
  int64_t reach;                               // 128·|n_j|
  int32_t side;                                // of n_a·n_j
  int32_t reach_fixed;                         // 2⁻²⁵ voxel along a

  HWY_ATTR HWY_INLINE void Set(const SmallTriangle& t, const TriangleRuns& face,
                               const ExactDepth& exact, double inverse, int k_axis, int j_axis) {
    const bool turned = k_axis != face.u;
    edges.Set(t, j_axis, k_axis, face.a);
    depth = face.depth;
    fall_k = turned ? face.fall_v : face.fall_u;
    fall_j = turned ? face.fall_u : face.fall_v;
    err = face.err;
    numerator = exact.numerator;
    step_k = int64_t{256} * (turned ? exact.step_v : exact.step_u);
    step_j = int64_t{256} * (turned ? exact.step_u : exact.step_v);
    divisor = exact.divisor;
    const int32_t n = t.n[j_axis];
    const int32_t size = n < 0 ? -n : n;
    reach = int64_t{128} * size;
    side = (t.n[face.a] < 0) == (n < 0) ? 1 : -1;
    reach_fixed = static_cast<int32_t>(static_cast<double>(size) * inverse * 0x1p24);
  }

  // By the definition.
  HWY_NOINLINE bool Exactly(int32_t k, int32_t j) const {
    const int64_t n = numerator + step_k * k + step_j * j;
    const int64_t i = FloorDiv(n, divisor * 256);
    const int64_t off = (n - (i * 256 + 128) * divisor) * side;
    bool lit = off >= -reach && off < reach;
    for (int e = 0; e < 3; ++e) {
      lit &= edges.base[e] + int64_t{edges.by_k[e]} * k + i * edges.by_j[e] >= 0;
    }
    return lit;
  }

  // All ones where lit; 0 where not, and where `there` is 0.
  HWY_ATTR HWY_INLINE VS Lit(VS k, VS j, hn::Mask<DS> there) const {
    const DS d;
    const VS at = hn::Add(hn::Set(d, static_cast<int32_t>(depth)),
                          hn::Add(hn::Mul(k, hn::Set(d, static_cast<int32_t>(fall_k))),
                                  hn::Mul(j, hn::Set(d, static_cast<int32_t>(fall_j)))));
    const VS i = hn::ShiftRight<kDepthBits>(at);
    const VS part = hn::And(at, hn::Set(d, (1 << kDepthBits) - 1));
    const VS off = hn::Abs(hn::Sub(part, hn::Set(d, 1 << (kDepthBits - 1))));
    VS least = hn::Set(d, INT32_MAX);
    for (int e = 0; e < 3; ++e) {
      const VS at_k = hn::Add(hn::Set(d, edges.base[e]), hn::Mul(k, hn::Set(d, edges.by_k[e])));
      least = hn::Min(least, hn::Add(at_k, hn::Mul(i, hn::Set(d, edges.by_j[e]))));
    }
    const VS bound = hn::Set(d, reach_fixed), room = hn::Set(d, static_cast<int32_t>(err));
    const auto inside = hn::And(there, hn::Gt(least, hn::Set(d, -1)));
    const VS lit = hn::VecFromMask(d, hn::And(inside, hn::Lt(off, bound)));
    const auto close = hn::Lt(hn::Abs(hn::Sub(off, bound)), hn::Add(room, hn::Set(d, 3)));
    const auto unsure = hn::Or(hn::And(inside, close), hn::And(there, hn::Lt(part, room)));
    if (HWY_LIKELY(hn::AllFalse(d, unsure))) return lit;
    HWY_ALIGN int32_t ks[kVectorRoom], js[kVectorRoom], lits[kVectorRoom], unsures[kVectorRoom];
    hn::Store(k, d, ks);
    hn::Store(j, d, js);
    hn::Store(lit, d, lits);
    hn::Store(hn::VecFromMask(d, unsure), d, unsures);
    for (size_t lane = 0; lane < hn::Lanes(d); ++lane) {
      if (unsures[lane] != 0) lits[lane] = Exactly(ks[lane], js[lane]) ? -1 : 0;
    }
    return hn::Load(d, lits);
  }
};

// The tiles of a triangle's bounds, and which of them are hit.
struct TileHits {
  static constexpr int32_t kStep[3] = {1, kMostTiles, kMostTiles* kMostTiles};
  int32_t tile[3], count[3];  // the first, and how many
  int32_t off[3];             // of the origin in its tile
  uint64_t hits[2];
  HWY_ALIGN uint16_t rows[128];  // of each those with columns

  HWY_INLINE void Set(const SmallTriangle& t) {
    for (int r = 0; r < 3; ++r) {
      tile[r] = t.origin[r] >> kTileBits;
      off[r] = t.origin[r] & (kTileSize - 1);
      count[r] = (off[r] + t.size[r] + kTileSize - 1) >> kTileBits;
    }
  }
  HWY_INLINE void Clear() {
    hits[0] = hits[1] = 0;
    std::fill_n(rows, 128, uint16_t{0});
  }
  HWY_INLINE void HitRows(int32_t at, uint64_t bits) {
    at &= 127;  // beyond them lies what has no rows
    rows[at] = static_cast<uint16_t>(rows[at] | bits);
    hits[at >> 6] |= uint64_t{(bits & 0xFFFF) != 0} << (at & 63);
  }
  HWY_INLINE uint64_t RowBit(int u, int32_t k) const {
    return uint64_t{1} << ((k + off[u]) & (kTileSize - 1));
  }
  // The voxel at i along axis r.
  HWY_INLINE int32_t At(int r, int32_t i) const { return ((i + off[r]) >> kTileBits) * kStep[r]; }
};

// Column j of row k.
HWY_INLINE void AddColumn(TriangleRuns& face, int32_t k, int32_t j, bool add,
                          const TileHits& tiles) {
  const int32_t column = j + tiles.off[face.v];
  uint16_t& bits = face.columns(column >> kTileBits)[k];
  bits = static_cast<uint16_t>(bits | int{add} << (column & (kTileSize - 1)));
}
HWY_INLINE uint32_t DepthAt(const TriangleRuns& face, int32_t k, int32_t j) {
  return face.depth + static_cast<uint32_t>(k) * face.fall_u +
         static_cast<uint32_t>(j) * face.fall_v;
}

// The columns of each tile along v, with what `lines` along v light, if any; and the tiles hit.
HWY_ATTR HWY_INLINE void SetColumns(const RunFinder& runs, const LineTest* lines,
                                    TriangleRuns& face, TileHits& tiles) {
  const DS d;
  const DH d16;
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  const int a = face.a, u = face.u, v = face.v;
  const VS fall_u = hn::Set(d, static_cast<int32_t>(face.fall_u));
  const VS fall_v = hn::Set(d, static_cast<int32_t>(face.fall_v));
  const VS err = hn::Set(d, static_cast<int32_t>(face.err)), one = hn::Set(d, 1);
  const VS five_bits = hn::Set(d, 31);  // of what is wanted; the rest may be anything
  // Two at least, of which the second may have nothing: seldom are there more, and a branch could not be foreseen.
  const int32_t count_v = std::max(2, tiles.count[v]), count_a = std::max(2, tiles.count[a]);
  VS k = hn::Iota(d, 0);
  for (int32_t row = 0; row < face.rows; row += lanes, k = hn::Add(k, hn::Set(d, lanes))) {
    const auto there = hn::Lt(k, hn::Set(d, int32_t{face.rows}));
    VS run_first, run_end;
    runs.Find(k, run_first, run_end);
    if (lines != nullptr) {
      const VS low = lines->Lit(k, hn::Sub(run_first, one), there);
      const VS high = lines->Lit(k, run_end, there);
      run_first = hn::Add(run_first, low);
      run_end = hn::Sub(run_end, high);
    }
    const VS depth = hn::Add(hn::Set(d, static_cast<int32_t>(face.depth)), hn::Mul(k, fall_u));
    const int32_t row_in_tile = (row + tiles.off[u]) & (kTileSize - 1);
    const int32_t at_row = tiles.At(u, row);
    for (int32_t tv = 0; tv < count_v; ++tv) {
      const int32_t from = tv * kTileSize - tiles.off[v];
      const VS origin = hn::Set(d, from);
      const VS first = hn::Max(run_first, origin);
      const VS end = hn::Min(run_end, hn::Set(d, from + kTileSize));
      const auto some = hn::And(there, hn::Lt(first, end));
      const VS bits = hn::Sub(hn::Shl(one, hn::And(hn::Sub(end, origin), five_bits)),
                              hn::Shl(one, hn::And(hn::Sub(first, origin), five_bits)));
      hn::StoreU(hn::DemoteTo(d16, hn::IfThenElseZero(some, bits)), d16, face.columns(tv) + row);
      const VS p = hn::Add(depth, hn::Mul(first, fall_v)),
               q = hn::Add(depth, hn::Mul(hn::Sub(end, one), fall_v));
      const VS least = hn::ShiftRight<kDepthBits>(hn::Sub(hn::Min(p, q), err));
      const VS most = hn::ShiftRight<kDepthBits>(hn::Max(p, q));
      for (int32_t ta = 0; ta < count_a; ++ta) {
        const int32_t lower = ta * kTileSize - tiles.off[a];
        const auto meets = hn::And(some, hn::And(hn::Lt(least, hn::Set(d, lower + kTileSize)),
                                                 hn::Gt(most, hn::Set(d, lower - 1))));
        const uint64_t rows = uint64_t{BitsOf(meets)} << row_in_tile;
        const int32_t at = at_row + tv * tiles.kStep[v] + ta * tiles.kStep[a];
        tiles.HitRows(at, rows);
        tiles.HitRows(at + tiles.kStep[u], rows >> kTileSize);
      }
    }
  }
}

// The columns that lines along u light.
HWY_ATTR HWY_INLINE void AddLinesAlongRows(const RunFinder& runs, const LineTest& lines,
                                           int32_t columns, TriangleRuns& face, TileHits& tiles) {
  const DS d;
  const VS one = hn::Set(d, 1);
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  VS j = hn::Iota(d, 0);
  HWY_ALIGN int32_t ks[2 * kVectorRoom];
  for (int32_t column = 0; column < columns; column += lanes, j = hn::Add(j, hn::Set(d, lanes))) {
    const auto there = hn::Lt(j, hn::Set(d, columns));
    VS low, high;
    runs.Find(j, low, high);
    low = hn::Sub(low, one);
    const uint64_t lit_low = BitsOf(hn::MaskFromVec(lines.Lit(j, low, there)));
    const uint64_t lit_high = BitsOf(hn::MaskFromVec(lines.Lit(j, high, there)));
    hn::StoreU(low, d, ks);
    hn::StoreU(high, d, ks + lanes);
    for (uint64_t lit = lit_low | lit_high << lanes; lit != 0; lit &= lit - 1) {
      const int lane = std::countr_zero(lit);
      const int32_t k = ks[lane], at_j = column + (lane & (lanes - 1));
      AddColumn(face, k, at_j, true, tiles);
      const uint32_t depth = DepthAt(face, k, at_j);
      const int32_t at = tiles.At(face.u, k) + tiles.At(face.v, at_j);
      for (uint32_t i : {depth, depth - face.err}) {
        tiles.HitRows(at + tiles.At(face.a, std::max(0, static_cast<int32_t>(i) >> kDepthBits)),
                      tiles.RowBit(face.u, k));
      }
    }
  }
}

HWY_INLINE void AddVertices(const SmallTriangle& t, TriangleRuns& face, TileHits& tiles) {
  for (int n = 0; n < 3; ++n) {
    const int32_t i = t.p[face.a][n] >> 8, k = t.p[face.u][n] >> 8, j = t.p[face.v][n] >> 8;
    const uint32_t depth = DepthAt(face, k, j);
    const bool at_depth = static_cast<int32_t>(depth) >> kDepthBits == i &&
                          static_cast<int32_t>(depth - face.err) >> kDepthBits == i;
    AddColumn(face, k, j, at_depth, tiles);
    const auto voxel =
        static_cast<uint32_t>(i << (8 * face.a) | k << (8 * face.u) | j << (8 * face.v));
    face.vertices[n] = at_depth ? TriangleRuns::kNoVertex : voxel;
    const int32_t at = tiles.At(face.a, i) + tiles.At(face.u, k) + tiles.At(face.v, j);
    tiles.HitRows(at, at_depth ? tiles.RowBit(face.u, k) : 0);
    tiles.hits[at >> 6] |= uint64_t{1} << (at & 63);
  }
}

// An item for each tile that is hit.
HWY_INLINE void PutItems(const TileHits& tiles, uint32_t item, uint32_t part, const WalkGrid& grid,
                         const uint8_t* owned, FoundSpans& found) {
  constexpr size_t kMost = kMostTiles * kMostTiles * kMostTiles;
  found.tiles.Reserve(found.size, kMost);
  found.items.Reserve(found.size, kMost);
  uint32_t* const to = found.tiles.data();
  BinItem* const items = found.items.data();
  size_t size = found.size;
  bool whole = true;  // within the volume
  for (int r = 0; r < 3; ++r) {
    whole &=
        tiles.tile[r] >= 0 && (tiles.tile[r] + tiles.count[r] - 1) * kTileSize < grid.voxels[r];
  }
  const int32_t first = tiles.tile[0] * grid.tile_step[0] + tiles.tile[1] * grid.tile_step[1] +
                        tiles.tile[2] * grid.tile_step[2];
  for (size_t half = 0; half < 2; ++half) {
    for (uint64_t left = tiles.hits[half]; left != 0; left &= left - 1) {
      const auto at =
          static_cast<uint32_t>(half * 64) + static_cast<uint32_t>(std::countr_zero(left));
      const uint32_t zy = at / kMostTiles;
      const uint32_t xyz[3] = {at - zy * kMostTiles, zy % kMostTiles, zy / kMostTiles};
      bool inside = true;
      int32_t tile = first;
      for (int r = 0; r < 3; ++r) {
        const auto i = static_cast<int32_t>(xyz[r]);
        tile += i * grid.tile_step[r];
        if (!whole) {
          inside &= tiles.tile[r] + i >= 0 && (tiles.tile[r] + i) * kTileSize < grid.voxels[r];
        }
      }
      if (!inside) continue;
      to[size] = static_cast<uint32_t>(tile);
      const uint32_t rows = tiles.rows[at];
      const int row = std::countr_zero(rows | 1u << 15);
      items[size] = BinItem::Face(item, part, static_cast<uint32_t>(row),
                                  static_cast<uint32_t>(std::bit_width(rows >> row)));
      size += owned[tile] != 0;
    }
  }
  found.size = size;
}

// The face along axis a; `whole`: and what else belongs to the triangle.
HWY_ATTR HWY_INLINE void MakeFace(const SmallTriangle& t, int a, bool whole, TriangleRuns& face,
                                  TileHits& tiles) {
  int u = (a + 1) % 3, v = (a + 2) % 3;
  if (t.size[u] > t.size[v]) std::swap(u, v);  // few rows
  const int32_t sign = t.n[a] < 0 ? -1 : 1;
  std::copy_n(t.origin, 3, face.origin);
  face.word = t.word;
  ExactDepth exact;
  exact.divisor = t.n[a] * sign;
  exact.step_u = -t.n[u] * sign;
  exact.step_v = -t.n[v] * sign;
  exact.numerator = int64_t{exact.divisor} * t.p[a][0] + int64_t{exact.step_u} * (128 - t.p[u][0]) +
                    int64_t{exact.step_v} * (128 - t.p[v][0]);
  const double inverse = 1.0 / exact.divisor;
  uint32_t err = 0;
  face.depth = CeilFixed(exact.numerator, kDepthBits - 8, exact.divisor, inverse, 1, &err);
  face.fall_u = CeilFixed(exact.step_u, kDepthBits, exact.divisor, inverse,
                          static_cast<uint32_t>(t.size[u]), &err);
  face.fall_v = CeilFixed(exact.step_v, kDepthBits, exact.divisor, inverse,
                          static_cast<uint32_t>(t.size[v]), &err);
  face.err = err;
  face.a = static_cast<uint8_t>(a);
  face.u = static_cast<uint8_t>(u);
  face.v = static_cast<uint8_t>(v);
  face.rows = static_cast<uint8_t>(t.size[u]);
  face.stride = static_cast<uint8_t>((t.size[u] + 15) & ~15);
  face.tiles = static_cast<uint8_t>(tiles.count[v]);
  tiles.Clear();
  const auto lines_along = [&](int r) {
    return whole && t.n[r] != 0 && t.n[r] != t.n[a] && t.n[r] != -t.n[a];
  };
  EdgeFunctions edges;
  edges.Set(t, a, u, v);
  RunFinder runs;
  LineTest lines;
  runs.Set(edges, edges.by_k, edges.by_j, t.size[v]);
  if (HWY_LIKELY(lines_along(v))) {
    lines.Set(t, face, exact, inverse, u, v);
    SetColumns(runs, &lines, face, tiles);
  } else {
    SetColumns(runs, nullptr, face, tiles);
  }
  if (HWY_LIKELY(lines_along(u))) {
    runs.Set(edges, edges.by_j, edges.by_k, t.size[u]);
    lines.Set(t, face, exact, inverse, v, u);
    AddLinesAlongRows(runs, lines, t.size[v], face, tiles);
  }
  face.exact() = exact;
  std::fill_n(face.vertices, 4, TriangleRuns::kNoVertex);
  if (whole) AddVertices(t, face, tiles);
}

HWY_ATTR inline void FindTrianglesIn(const SmallTriangle* triangles, size_t count, uint32_t part,
                                     const WalkGrid& grid, const uint8_t* owned,
                                     TriangleMemory& memory, FoundSpans& found) {
  TileHits tiles;
  for (const SmallTriangle* end = triangles + count; triangles != end; ++triangles) {
    const SmallTriangle& t = *triangles;
    tiles.Set(t);
    int32_t greatest = 0;
    for (int32_t n : t.n) greatest = std::max(greatest, n < 0 ? -n : n);
    bool whole = true;
    for (int a = 0; a < 3; ++a) {
      if (t.n[a] != greatest && t.n[a] != -greatest) continue;
      memory.units.Reserve(memory.size, TriangleRuns::kMostUnits);
      TriangleRuns& face = memory.units.data()[memory.size];
      MakeFace(t, a, whole, face, tiles);
      PutItems(tiles, static_cast<uint32_t>(memory.size), part, grid, owned, found);
      memory.size += face.units();
      whole = false;
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
