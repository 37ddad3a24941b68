// What is worked out of small triangles' faces before their runs (triangle_find-inl.h), a face a lane. Once for each
// instruction set.
#if defined(VOXELD_GPU_ASSEMBLE_TRIANGLE_SETUP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_TRIANGLE_SETUP_INL_H_
#undef VOXELD_GPU_ASSEMBLE_TRIANGLE_SETUP_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_TRIANGLE_SETUP_INL_H_
#endif

#include "gpu/assemble/draw_block-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

using DS = hn::RebindToSigned<DW>;
using VS = hn::Vec<DS>;
using DF = hn::RebindToFloat<DW>;

constexpr size_t kLanes = hn::MaxLanes(DS());
static_assert(kLanes <= ExactDepths::kMost);

// A field of as many faces as a vector has lanes.
struct Field {
  alignas(64) int32_t at[kLanes];

  HWY_ATTR HWY_INLINE void Set(VS v) { hn::Store(v, DS(), at); }
  HWY_ATTR HWY_INLINE VS Get() const { return hn::Load(DS(), at); }
};

// Which face each lane is of.
class Faces {
 public:
  HWY_ATTR HWY_INLINE explicit Faces(VS lanes) : lanes_(hn::IndicesFromVec(DS(), lanes)) {}
  HWY_ATTR HWY_INLINE VS Of(const Field& field) const {
    return hn::TableLookupLanes(field.Get(), lanes_);
  }

 private:
  decltype(hn::IndicesFromVec(DS(), VS())) lanes_;
};

// Of a projection, twice the signed areas of edges and voxel (k, j): base + k·by_k + j·by_j; inside of all three ≥ 0.
struct EdgeFunctions {
  Field base[3], by_k[3], by_j[3];

  // `pk`, `pj`: vertices; `sign`: of the area in (j, k).
  HWY_ATTR HWY_INLINE void Set(const VS pk[3], const VS pj[3], VS sign) {
    const VS centre = hn::Set(DS(), 128);
    for (int i = 0; i < 3; ++i) {
      const int next = i == 2 ? 0 : i + 1;
      const VS dj = hn::Mul(hn::Sub(pj[next], pj[i]), sign);
      const VS dk = hn::Mul(hn::Sub(pk[next], pk[i]), sign);
      base[i].Set(
          hn::Sub(hn::Mul(dj, hn::Sub(centre, pk[i])), hn::Mul(dk, hn::Sub(centre, pj[i]))));
      by_k[i].Set(hn::ShiftLeft<8>(dj));
      by_j[i].Set(hn::Neg(hn::ShiftLeft<8>(dk)));
    }
  }
};

// For rows k the columns j inside all three edges: of each edge ⌊E/|by_j|⌋ + 1 is where it ends a run, if it falls along j,
// and its negative where it begins one. The quotient, below 2²², is first taken to the nearest whole number in single
// precision, which is right where it matters (beyond 2⁷ only its sign does); the remainder makes it the one below.
struct RunFinder {
  Field base[3], by_k[3], by_j[3];
  Field inverse[3];  // floats
  Field columns;

  // Edges along (k, j), of which `pk` and `sign` were.
  HWY_ATTR HWY_INLINE void SetEdge(int i, VS edge_base, VS edge_by_k, VS edge_by_j, VS pk) {
    const DS d;
    const DF df;
    const VS zero = hn::Zero(d), one = hn::Set(d, 1);
    // A whole row is inside, or none of it: 2E + 1, of an edge one unit long, times 64.
    const auto level = hn::Eq(edge_by_j, zero);
    const VS unit = hn::IfThenElse(hn::Lt(edge_by_k, zero), hn::Set(d, -1), one);
    const VS level_base = hn::Add(hn::Mul(unit, hn::Sub(hn::Set(d, 256), hn::Add(pk, pk))), one);
    base[i].Set(hn::IfThenElse(level, level_base, edge_base));
    by_k[i].Set(hn::IfThenElse(level, hn::ShiftLeft<9>(unit), edge_by_k));
    by_j[i].Set(edge_by_j);
    const auto guess = hn::Div(hn::Set(df, 1.0f), hn::ConvertTo(df, hn::Abs(edge_by_j)));
    inverse[i].Set(
        hn::BitCast(d, hn::IfThenElse(hn::RebindMask(df, level), hn::Set(df, 64.0f), guess)));
  }

  // From 0 to `columns`; first ≥ end where there are none.
  HWY_ATTR HWY_INLINE void Find(const Faces& faces, VS k, VS& first, VS& end) const {
    const DS d;
    const DF df;
    const VS one = hn::Set(d, 1), zero = hn::Zero(d), most = faces.Of(columns);
    const auto magic = hn::Set(df, 0x1.8p23f);  // whole numbers in a float's lower bits
    first = zero;
    end = most;
    for (int i = 0; i < 3; ++i) {
      const VS slope = faces.Of(by_j[i]);
      const VS steep = hn::Abs(slope);
      const VS x = hn::Add(faces.Of(base[i]), hn::Mul(k, faces.Of(by_k[i])));
      const auto guess = hn::Mul(hn::ConvertTo(df, x), hn::BitCast(df, faces.Of(inverse[i])));
      VS q = hn::Sub(hn::BitCast(d, hn::Add(guess, magic)), hn::BitCast(d, magic));
      q = hn::Add(q, hn::ShiftRight<31>(hn::Sub(x, hn::Mul(q, steep))));
      const auto rises = hn::Gt(slope, zero);
      end = hn::IfThenElse(rises, end, hn::Min(end, hn::Add(q, one)));
      first = hn::IfThenElse(rises, hn::Max(first, hn::Neg(q)), first);
    }
    first = hn::Min(first, most);
    end = hn::Max(end, zero);
  }
};

// Whether lines along j's axis light voxels that lie in the columns (k, j) of a face.
struct LineTest {
  EdgeFunctions edges;  // of the projection along j's axis, over k and the voxels of the first axis
  Field reach;          // 2⁻²⁵ voxel; −1 where there are no such lines
  bool any;
};

// As many faces as a vector has lanes, or fewer.
struct FaceBatch {
  Field depth, fall_u, fall_v, err;
  Field off[3];    // of the origin in its tile, by role
  Field tile[3];   // the first
  Field count[3];  // of tiles
  Field voxels_u, voxels_v;
  Field n[3], axis[3];
  RunFinder rows, columns;
  LineTest along_v, along_u;
  HWY_ALIGN double numerator[kLanes];
  Field step_u, step_v, divisor;
  int32_t most[3];  // tiles, by role

  HWY_ATTR inline void Set(const SmallTriangles& t, size_t begin) {
    const DS d;
    const VS zero = hn::Zero(d), one = hn::Set(d, 1);
    VS p[3][3], normal[3];
    for (int r = 0; r < 3; ++r) {
      for (int i = 0; i < 3; ++i) p[r][i] = hn::LoadU(d, t.p[r][i] + begin);
      normal[r] = hn::LoadU(d, t.n[r] + begin);
      n[r].Set(normal[r]);
      axis[r].Set(hn::LoadU(d, t.axis[r] + begin));
      const VS origin = hn::LoadU(d, t.origin[r] + begin);
      const VS in_tile = hn::And(origin, hn::Set(d, kTileSize - 1));
      off[r].Set(in_tile);
      tile[r].Set(hn::ShiftRight<kTileBits>(origin));
      const VS tiles = hn::ShiftRight<kTileBits>(
          hn::Add(hn::Add(in_tile, hn::LoadU(d, t.voxels[r] + begin)), hn::Set(d, kTileSize - 1)));
      count[r].Set(tiles);
      most[r] = hn::GetLane(hn::MaxOfLanes(d, tiles));
    }
    const VS rows_of = hn::LoadU(d, t.voxels[1] + begin),
             columns_of = hn::LoadU(d, t.voxels[2] + begin);
    voxels_u.Set(rows_of);
    voxels_v.Set(columns_of);
    rows.columns.Set(columns_of);
    columns.columns.Set(rows_of);

    const VS cyclic = hn::LoadU(d, t.cyclic + begin);
    const auto sign = [&](int along, VS turned) HWY_ATTR {
      const VS down = hn::ShiftRight<31>(normal[along]);
      return hn::Or(hn::Not(hn::Xor(down, turned)), one);
    };
    EdgeFunctions face;
    face.Set(p[1], p[2], sign(0, cyclic));
    along_v.edges.Set(p[1], p[0], sign(2, hn::Not(cyclic)));
    along_u.edges.Set(p[2], p[0], sign(1, cyclic));
    for (int i = 0; i < 3; ++i) {
      const VS base = face.base[i].Get(), by_k = face.by_k[i].Get(), by_j = face.by_j[i].Get();
      rows.SetEdge(i, base, by_k, by_j, p[1][i]);
      columns.SetEdge(i, base, by_j, by_k, p[2][i]);
    }

    const VS divide = hn::Abs(normal[0]);
    const VS turn = hn::Not(hn::ShiftRight<31>(normal[0]));  // −n if n_a > 0
    const VS by_u = hn::Sub(hn::Xor(normal[1], turn), turn);
    const VS by_v = hn::Sub(hn::Xor(normal[2], turn), turn);
    const VS centre = hn::Set(d, 128);
    divisor.Set(divide);
    step_u.Set(by_u);
    step_v.Set(by_v);
    Field at_a, from_u, from_v, reach_u, reach_v;
    at_a.Set(p[0][0]);
    from_u.Set(hn::Sub(centre, p[1][0]));
    from_v.Set(hn::Sub(centre, p[2][0]));
    SetQuotients(at_a, from_u, from_v, reach_u, reach_v);

    // Whole numbers modulo 2³² suffice for remainders, which are less than half a divisor.
    const VS low = hn::Add(hn::Mul(divide, at_a.Get()),
                           hn::Add(hn::Mul(by_u, from_u.Get()), hn::Mul(by_v, from_v.Get())));
    VS room = zero;
    const auto round_up = [&](Field& quotient, VS numerator_low, VS weight) HWY_ATTR {
      const VS rest = hn::Sub(numerator_low, hn::Mul(quotient.Get(), divide));
      room = hn::Add(room, hn::IfThenZeroElse(hn::Eq(rest, zero), weight));
      quotient.Set(hn::Sub(quotient.Get(), hn::VecFromMask(d, hn::Gt(rest, zero))));
    };
    round_up(depth, hn::ShiftLeft<kDepthBits - 8>(low), one);
    round_up(fall_u, hn::ShiftLeft<kDepthBits>(by_u), rows_of);
    round_up(fall_v, hn::ShiftLeft<kDepthBits>(by_v), columns_of);
    err.Set(room);

    const VS whole = hn::LoadU(d, t.whole + begin);
    const auto lines = [&](int r, LineTest& test, const Field& reach) HWY_ATTR {
      const VS size = hn::Abs(normal[r]);
      const auto some =
          hn::And(hn::MaskFromVec(whole), hn::And(hn::Gt(size, zero), hn::Lt(size, divide)));
      test.reach.Set(hn::IfThenElse(some, reach.Get(), hn::Set(d, -1)));
      test.any = !hn::AllFalse(d, some);
    };
    lines(2, along_v, reach_v);
    lines(1, along_u, reach_u);
  }

 private:
  // The numerators; depth and falls in 2⁻²⁵ voxel modulo 2³², to the nearest or nearly so: off by less than ½ + 2⁻¹⁷.
  HWY_ATTR HWY_INLINE void SetQuotients(const Field& at_a, const Field& from_u, const Field& from_v,
                                        Field& reach_u, Field& reach_v) {
    const hn::CappedTag<double, 8> d;
    const hn::RebindToUnsigned<decltype(d)> d64;
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<uint32_t, decltype(d)> du32;
    // Whole numbers in a double's lower bits.
    const auto magic = hn::Set(d, 0x1.8p52);
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      const auto in = [&](const Field& field)
                          HWY_ATTR { return hn::PromoteTo(d, hn::Load(d32, field.at + i)); };
      const auto out = [&](Field& field, auto x) HWY_ATTR {
        const auto bits = hn::BitCast(d64, hn::Add(x, magic));
        hn::Store(hn::BitCast(d32, hn::TruncateTo(du32, bits)), d32, field.at + i);
      };
      const auto by = in(divisor), by_u = in(step_u), by_v = in(step_v);
      const auto inverse = hn::Div(hn::Set(d, 1.0), by);
      const auto whole = hn::Add(hn::Mul(by, in(at_a)),
                                 hn::Add(hn::Mul(by_u, in(from_u)), hn::Mul(by_v, in(from_v))));
      hn::Store(whole, d, numerator + i);
      const auto scaled = hn::Mul(inverse, hn::Set(d, 0x1p25));
      out(depth, hn::Mul(whole, hn::Mul(inverse, hn::Set(d, 0x1p17))));
      out(fall_u, hn::Mul(by_u, scaled));
      out(fall_v, hn::Mul(by_v, scaled));
      const auto half = hn::Mul(inverse, hn::Set(d, 0x1p24));
      hn::Store(hn::DemoteTo(d32, hn::Mul(hn::Abs(by_u), half)), d32, reach_u.at + i);
      hn::Store(hn::DemoteTo(d32, hn::Mul(hn::Abs(by_v), half)), d32, reach_v.at + i);
    }
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
