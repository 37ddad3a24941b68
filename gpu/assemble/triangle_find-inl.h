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

using DF = hn::CappedTag<double, 8>;
using VF = hn::Vec<DF>;
using DI = hn::Rebind<int32_t, DF>;

constexpr int kMostRuns = 64;
constexpr int kMostSingles = 4 * kMostRuns + 3;
constexpr int kVectorRoom = 16;

// The small things of one triangle, before it is known how many there are.
struct TriangleParts {
  HWY_ALIGN uint16_t runs[kMostRuns + kVectorRoom];
  HWY_ALIGN uint32_t singles[kMostSingles + kVectorRoom];
  size_t single_count;
};

// x · 2^shift / divisor rounded up, where that is below 2³⁴ and the product below 2⁶³; adds `weight` to `err` if it was
// rounded.
HWY_INLINE int64_t CeilFixed(int64_t x, int shift, int32_t divisor, double inverse,
                             uint32_t weight, uint32_t* err) {
  const int64_t scaled = x * (int64_t{1} << shift);
  // Less than 1 + 2⁻¹⁰ from the quotient.
  auto q = static_cast<int64_t>(static_cast<double>(scaled) * inverse);
  int64_t rest = scaled - q * divisor;
  const int64_t up = int64_t{rest > 0} + int64_t{rest > divisor};
  q += up;
  rest -= up * divisor;
  const auto down = int64_t{rest <= -divisor};
  *err += rest + down * divisor != 0 ? weight : 0;
  return q - down;
}

// An edge function along an axis: its value is at(k, j) = base + k·by_k + j·by_j for whole k and j.
struct EdgeFunction {
  double base, by_k, by_j;
};

// Edges of the projection along axis `along` onto (k, j) axes, all ≥ 0 inside.
HWY_INLINE void SetEdges(const SmallTriangle& t, int along, int k, int j, EdgeFunction edges[3]) {
  // The sign of the area in (j, k).
  const bool cyclic = j == (along + 1) % 3;
  const int32_t sign = (t.n[along] < 0) == cyclic ? -1 : 1;
  for (int i = 0; i < 3; ++i) {
    const int next = i == 2 ? 0 : i + 1;
    const int32_t dj = (t.p[next][j] - t.p[i][j]) * sign, dk = (t.p[next][k] - t.p[i][k]) * sign;
    edges[i] = {static_cast<double>(dj * (128 - t.p[i][k]) - dk * (128 - t.p[i][j])),
                static_cast<double>(dj * 256), static_cast<double>(-dk * 256)};
  }
}

// The plane over the columns along the dominant axis.
struct Plane {
  double numerator, by_k, by_j;  // N
  double inverse, divisor;
};

// For each k the run of j in the projection along axis a; singles of lines along j's axis at its ends, if `j_lines`. `runs`
// may be null.
HWY_ATTR HWY_INLINE void FindRuns(const SmallTriangle& t, int a, int k_axis, int j_axis,
                                  const Plane& plane, bool j_lines, uint16_t* runs,
                                  TriangleParts& parts) {
  const DF d;
  const DI di;
  const hn::Rebind<uint16_t, DF> d16;
  const hn::Rebind<uint32_t, DF> du;
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  EdgeFunction edges[3], crossing[3];
  SetEdges(t, a, k_axis, j_axis, edges);
  SetEdges(t, j_axis, k_axis, a, crossing);
  // ⌊(x + ½)·inverse⌋ is where edge i ends a run, if it falls along j, or begins it: negated.
  constexpr double kFar = 1 << 20;
  double inverse[3], end_room[3], first_room[3];
  for (int i = 0; i < 3; ++i) {
    const bool rises = edges[i].by_j > 0;
    const double steep = rises ? edges[i].by_j : -edges[i].by_j;
    inverse[i] = steep == 0 ? kFar : 1.0 / steep;  // a whole row is inside or none of it
    end_room[i] = rises ? kFar : 0;
    first_room[i] = rises ? 0 : kFar;
  }
  const int32_t rows = t.size[k_axis];
  const VF most = hn::Set(d, static_cast<double>(t.size[j_axis])), zero = hn::Zero(d);
  const VF half = hn::Set(d, 0.5), one = hn::Set(d, 1.0);
  const VF divisor = hn::Set(d, plane.divisor), middle = hn::Set(d, plane.divisor * 0.5);
  const VF depth_inverse = hn::Set(d, plane.inverse), depth_by_j = hn::Set(d, plane.by_j);
  const double reach = 128.0 * static_cast<double>(t.n[j_axis] < 0 ? -t.n[j_axis] : t.n[j_axis]);
  const double side = (t.n[a] < 0) == (t.n[j_axis] < 0) ? 1.0 : -1.0;
  const VF high = hn::Set(d, reach), low = hn::Set(d, -reach), sided = hn::Set(d, side);
  const VF place_k = hn::Set(d, static_cast<double>(1 << (8 * k_axis)));
  const VF place_j = hn::Set(d, static_cast<double>(1 << (8 * j_axis)));
  const VF place_a = hn::Set(d, static_cast<double>(1 << (8 * a)));
  VF k = hn::ConvertTo(d, hn::Iota(hn::RebindToSigned<DF>(), 0));
  const VF k_step = hn::Set(d, static_cast<double>(lanes)),
           k_end = hn::Set(d, static_cast<double>(rows));
  size_t single_count = parts.single_count;
  for (int32_t row = 0; row < rows; row += lanes) {
    VF end = hn::Sub(most, one), first = zero;
    for (int i = 0; i < 3; ++i) {
      const VF x = hn::Add(hn::Set(d, edges[i].base + 0.5), hn::Mul(k, hn::Set(d, edges[i].by_k)));
      const VF q = hn::Floor(hn::Mul(x, hn::Set(d, inverse[i])));
      end = hn::Min(end, hn::Add(q, hn::Set(d, end_room[i])));
      first = hn::Max(first, hn::Neg(hn::Add(q, hn::Set(d, first_room[i]))));
    }
    first = hn::Min(first, most);
    end = hn::Max(hn::Add(end, one), zero);
    if (runs != nullptr) {
      const auto run = hn::Or(hn::DemoteTo(di, first), hn::ShiftLeft<8>(hn::DemoteTo(di, end)));
      hn::StoreU(hn::DemoteTo(d16, run), d16, runs + row);
    }
    if (j_lines) {
      const auto there = hn::Lt(k, k_end);
      const VF at_k = hn::Add(hn::Set(d, plane.numerator), hn::Mul(k, hn::Set(d, plane.by_k)));
      VF cross_k[3];
      for (int i = 0; i < 3; ++i) {
        cross_k[i] =
            hn::Add(hn::Set(d, crossing[i].base), hn::Mul(k, hn::Set(d, crossing[i].by_k)));
      }
      const VF packed_k = hn::Mul(k, place_k);
      const auto test = [&](VF j) HWY_ATTR {
        const VF n = hn::Add(at_k, hn::Mul(j, depth_by_j));
        const VF i = hn::Floor(hn::Mul(hn::Add(n, half), depth_inverse));
        const VF off =
            hn::Mul(hn::Sub(hn::Sub(n, hn::Mul(i, divisor)), middle), sided);
        VF inside = hn::Add(cross_k[0], hn::Mul(i, hn::Set(d, crossing[0].by_j)));
        for (int e = 1; e < 3; ++e) {
          inside =
              hn::Min(inside, hn::Add(cross_k[e], hn::Mul(i, hn::Set(d, crossing[e].by_j))));
        }
        const auto lit = hn::And(hn::And(there, hn::Ge(inside, zero)),
                                 hn::And(hn::Ge(off, low), hn::Lt(off, high)));
        const VF packed = hn::Add(packed_k, hn::Add(hn::Mul(j, place_j), hn::Mul(i, place_a)));
        const auto lit32 = hn::RebindMask(
            du, hn::MaskFromVec(hn::DemoteTo(
                    di, hn::IfThenElseZero(lit, hn::Set(d, -1.0)))));
        hn::StoreU(hn::Compress(hn::BitCast(du, hn::DemoteTo(di, packed)), lit32), du,
                   parts.singles + single_count);
        single_count += hn::CountTrue(d, lit);
      };
      test(hn::Sub(first, one));
      test(end);
    }
    k = hn::Add(k, k_step);
  }
  parts.single_count = single_count;
}

// Tiles of a triangle's bounds, counted from that of its origin; up to 5 an axis.
struct TileMarks {
  int32_t origin[3], count[3];  // tiles
  int32_t off[3];               // of the triangle's origin in its tile
  uint8_t hit[128];

  HWY_INLINE void Set(const SmallTriangle& t) {
    for (int r = 0; r < 3; ++r) {
      origin[r] = t.origin[r] >> kTileBits;
      off[r] = t.origin[r] & (kTileSize - 1);
      count[r] = (off[r] + t.size[r] + kTileSize - 1) >> kTileBits;
    }
  }
  HWY_INLINE int32_t Step(int r) const { return r == 0 ? 1 : r == 1 ? 5 : 25; }
};

// Marks the tiles in which a face may have voxels.
HWY_ATTR HWY_INLINE void MarkFace(const TriangleRuns& face, const uint16_t* runs,
                                  TileMarks& marks) {
  const DW du;
  const hn::RebindToSigned<DW> d;
  const hn::Rebind<uint16_t, DW> d16;
  const auto lanes = static_cast<int32_t>(hn::Lanes(d));
  const int a = face.a, u = face.u, v = face.v;
  const auto fall_u = hn::Set(d, static_cast<int32_t>(face.fall_u));
  const auto fall_v = hn::Set(d, static_cast<int32_t>(face.fall_v));
  const auto err = hn::Set(d, static_cast<int32_t>(face.err));
  auto k = hn::Iota(d, 0);
  for (int32_t row = 0; row < face.rows; row += lanes, k = hn::Add(k, hn::Set(d, lanes))) {
    const auto run = hn::PromoteTo(du, hn::LoadU(d16, runs + row));
    const auto run_first = hn::BitCast(d, hn::And(run, hn::Set(du, 0xFF)));
    const auto run_end = hn::BitCast(d, hn::ShiftRight<8>(run));
    const auto there = hn::Lt(k, hn::Set(d, int32_t{face.rows}));
    const auto depth = hn::Add(hn::Set(d, static_cast<int32_t>(face.depth)), hn::Mul(k, fall_u));
    for (int32_t tv = 0; tv < marks.count[v]; ++tv) {
      const int32_t from = tv * kTileSize - marks.off[v];
      const auto first = hn::Max(run_first, hn::Set(d, from));
      const auto end = hn::Min(run_end, hn::Set(d, from + kTileSize));
      const auto last = hn::Sub(end, hn::Set(d, 1));
      const auto some = hn::And(there, hn::Lt(first, end));
      const auto p = hn::Add(depth, hn::Mul(first, fall_v)),
                 q = hn::Add(depth, hn::Mul(last, fall_v));
      const auto least = hn::ShiftRight<kDepthBits>(hn::Sub(hn::Min(p, q), err));
      const auto most = hn::ShiftRight<kDepthBits>(hn::Max(p, q));
      for (int32_t ta = 0; ta < marks.count[a]; ++ta) {
        const int32_t lower = ta * kTileSize - marks.off[a];
        const auto meets = hn::And(some, hn::And(hn::Lt(least, hn::Set(d, lower + kTileSize)),
                                                 hn::Gt(most, hn::Set(d, lower - 1))));
        for (int32_t tu = 0; tu < marks.count[u]; ++tu) {
          const int32_t begin = tu * kTileSize - marks.off[u];
          const auto here = hn::And(hn::Gt(k, hn::Set(d, begin - 1)),
                                    hn::Lt(k, hn::Set(d, begin + kTileSize)));
          marks.hit[tv * marks.Step(v) + ta * marks.Step(a) + tu * marks.Step(u)] |=
              !hn::AllFalse(d, hn::And(meets, here));
        }
      }
    }
  }
}

// Marks the tiles of singles; there is room behind them.
HWY_ATTR HWY_INLINE void MarkSingles(const uint32_t* singles, size_t count, TileMarks& marks) {
  const DW d;
  HWY_ALIGN uint32_t at[kVectorRoom];
  const auto off = hn::Set(d, static_cast<uint32_t>(marks.off[0] | marks.off[1] << 8 |
                                                    marks.off[2] << 16));
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const VW voxel = hn::Add(hn::LoadU(d, singles + i), off);
    const VW x = hn::And(hn::ShiftRight<kTileBits>(voxel), hn::Set(d, 0xF)),
             y = hn::And(hn::ShiftRight<kTileBits + 8>(voxel), hn::Set(d, 0xF)),
             z = hn::ShiftRight<kTileBits + 16>(voxel);
    hn::Store(hn::Add(x, hn::Add(hn::Mul(y, hn::Set(d, 5)), hn::Mul(z, hn::Set(d, 25)))), d, at);
    for (size_t lane = 0; lane < std::min(hn::Lanes(d), count - i); ++lane) {
      marks.hit[at[lane]] = 1;
    }
  }
}

// Appends a face and its tiles.
HWY_ATTR HWY_INLINE void PutFace(const TriangleRuns& face, const TriangleParts& parts,
                                 uint32_t part, const WalkGrid& grid, const uint8_t* owned,
                                 TileMarks& marks, TriangleMemory& memory, FoundSpans& found) {
  std::fill(marks.hit, marks.hit + sizeof(marks.hit), uint8_t{0});
  MarkFace(face, parts.runs, marks);
  MarkSingles(parts.singles, face.singles, marks);
  const size_t run_bytes = (size_t{face.rows} + 1) / 2 * 4;
  const size_t units = 1 + (run_bytes + face.singles * sizeof(uint32_t) + 63) / 64;
  memory.units.Reserve(memory.size, units + 1);  // and what is read beyond the last
  TriangleRuns* const to = memory.units.data() + memory.size;
  *to = face;
  auto* const behind = reinterpret_cast<std::byte*>(to + 1);
  std::memcpy(behind, parts.runs, run_bytes);
  std::memcpy(behind + run_bytes, parts.singles, face.singles * sizeof(uint32_t));
  const BinItem item = BinItem::Span(static_cast<uint32_t>(memory.size), part, 1);
  memory.size += units;

  int32_t lo[3], hi[3];
  size_t most = 1;
  for (int r = 0; r < 3; ++r) {
    const int32_t tiles = (grid.voxels[r] + kTileSize - 1) >> kTileBits;
    lo[r] = std::max(0, -marks.origin[r]);
    hi[r] = std::min(marks.count[r], tiles - marks.origin[r]);
    if (lo[r] >= hi[r]) return;
    most *= static_cast<size_t>(hi[r] - lo[r]);
  }
  found.tiles.Reserve(found.size, most);
  found.items.Reserve(found.size, most);
  for (int32_t z = lo[2]; z < hi[2]; ++z) {
    for (int32_t y = lo[1]; y < hi[1]; ++y) {
      for (int32_t x = lo[0]; x < hi[0]; ++x) {
        const auto tile = static_cast<uint32_t>((marks.origin[0] + x) * grid.tile_step[0] +
                                                (marks.origin[1] + y) * grid.tile_step[1] +
                                                (marks.origin[2] + z) * grid.tile_step[2]);
        found.tiles.data()[found.size] = tile;
        found.items.data()[found.size] = item;
        found.size += (marks.hit[x + 5 * y + 25 * z] & (owned[tile] != 0));
      }
    }
  }
}

HWY_ATTR inline void FindTrianglesIn(const SmallTriangle* triangles, size_t count, uint32_t part,
                                     const WalkGrid& grid, const uint8_t* owned,
                                     TriangleMemory& memory, FoundSpans& found) {
  TriangleParts parts;
  TileMarks marks;
  for (const SmallTriangle* end = triangles + count; triangles != end; ++triangles) {
    const SmallTriangle& t = *triangles;
    marks.Set(t);
    int32_t greatest = 0;
    for (int32_t n : t.n) greatest = std::max(greatest, n < 0 ? -n : n);
    parts.single_count = 0;
    bool first_face = true;
    for (int a = 0; a < 3; ++a) {
      if (t.n[a] != greatest && t.n[a] != -greatest) continue;
      int u = (a + 1) % 3, v = (a + 2) % 3;
      if (t.size[u] > t.size[v]) std::swap(u, v);  // few rows
      const int64_t sign = t.n[a] < 0 ? -1 : 1, n_u = t.n[u] * sign, n_v = t.n[v] * sign;
      const double inverse = 1.0 / greatest;
      TriangleRuns face;
      std::copy_n(t.origin, 3, face.origin);
      face.word = t.word;
      face.numerator = int64_t{greatest} * t.p[0][a] - n_u * (128 - t.p[0][u]) -
                       n_v * (128 - t.p[0][v]);
      face.step_u = static_cast<int32_t>(-n_u);
      face.step_v = static_cast<int32_t>(-n_v);
      face.divisor = greatest;
      face.err = 0;
      face.depth = static_cast<uint32_t>(
          CeilFixed(face.numerator, kDepthBits - 8, greatest, inverse, 1, &face.err));
      face.fall_u = static_cast<uint32_t>(CeilFixed(-n_u, kDepthBits, greatest, inverse,
                                                    static_cast<uint32_t>(t.size[u]), &face.err));
      face.fall_v = static_cast<uint32_t>(CeilFixed(-n_v, kDepthBits, greatest, inverse,
                                                    static_cast<uint32_t>(t.size[v]), &face.err));
      face.a = static_cast<uint8_t>(a);
      face.u = static_cast<uint8_t>(u);
      face.v = static_cast<uint8_t>(v);
      face.rows = static_cast<uint8_t>(t.size[u]);
      Plane plane;
      plane.numerator = static_cast<double>(face.numerator);
      plane.divisor = 256.0 * greatest;
      plane.inverse = inverse / 256;
      const auto lines = [&](int r) {
        return first_face && t.n[r] != 0 && t.n[r] != greatest && t.n[r] != -greatest;
      };
      plane.by_k = -256.0 * static_cast<double>(n_u);
      plane.by_j = -256.0 * static_cast<double>(n_v);
      FindRuns(t, a, u, v, plane, lines(v), parts.runs, parts);
      if (lines(u)) {
        std::swap(plane.by_k, plane.by_j);
        FindRuns(t, a, v, u, plane, true, nullptr, parts);
      }
      if (first_face) {
        for (const int32_t(&p)[3] : t.p) {
          parts.singles[parts.single_count++] =
              static_cast<uint32_t>(p[0] >> 8 | (p[1] >> 8) << 8 | (p[2] >> 8) << 16);
        }
      }
      face.singles = first_face ? static_cast<uint16_t>(parts.single_count) : uint16_t{0};
      PutFace(face, parts, part, grid, owned, marks, memory, found);
      first_face = false;
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
