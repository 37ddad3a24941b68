// The voxels of one triangle, in integers only.
//
// THIN (6-separating): for each axis along which the triangle has an area, every line through voxel
// centres parallel to it that meets the closed triangle lights the voxel ⌊depth⌋ of the crossing
// (exact, rational); the voxels of the three vertices are always covered, so that nothing vanishes.
// COVER (26-separating): the closed triangle and the voxel's closed box meet, by separating axes. A
// triangle without area is the line of its longest edge (the first of 01, 12, 20 if equal), THIN or
// COVER, and its vertices' voxels.
//
// Colour: the weights are the areas opposite to the vertices in the projection along the axis of
// the normal's greatest component (ties: x before y before z), taken at the voxel's centre and
// clamped at 0; the colour is (Σ w·C + ⌊Σw/2⌋) / Σw for each channel. With a texture (texture.h) it
// is multiplied by the texel at the place that is weighted in double precision.
//
// Guarantee: exact. A closed mesh of THIN triangles is 6-separating, one of COVER triangles
// 26-separating. The centre of a covered voxel is within half a voxel (COVER, and corners: half a
// voxel's diagonal) of the triangle. A shift by whole voxels shifts the result.
#pragma once

#include "gpu/primitives/fixed.h"
#include "gpu/primitives/line.h"
#include "gpu/primitives/texture.h"
#include "gpu/records.h"
#include "gpu/word.h"

namespace voxeld::gpu {

struct Triangle {
  Int3 v[3];
  uint32_t color[3] = {};  // 0x00RRGGBB
  SurfaceRule rule = SurfaceRule::kThin;
  TexturePlace texture;

  VOXELD_HD bool IsOfOneColor() const {
    return color[0] == color[1] && color[1] == color[2] && texture.texels == nullptr;
  }
  VOXELD_HD uint32_t ColorOfCorner(int i) const {
    return texture.texels == nullptr ? color[i] : Tinted(texture.OfCorner(i), color[i]);
  }
};

// Returns a box of all voxels whose closed boxes meet the triangle's bounding box; with a radius
// (units) also of all voxels whose centres are within it.
VOXELD_HD inline Box3 BoundsOf(const Triangle& t, int64_t radius = 0) {
  Box3 b;
  for (int a = 0; a < 3; ++a) {
    const int64_t low = Min(t.v[0][a], Min(t.v[1][a], t.v[2][a])) - radius;
    const int64_t high = Max(t.v[0][a], Max(t.v[1][a], t.v[2][a])) + radius;
    b.lo[a] = ToVoxel32(VoxelOf(low - 1));
    b.hi[a] = ToVoxel32(VoxelOf(high) + 1);
  }
  return b;
}

// Converts a number that is not negative: host and device round alike.
VOXELD_HD inline double ToDouble(int64_t value) { return static_cast<double>(value); }
VOXELD_HD inline double ToDouble(Wide value) {
  return static_cast<double>(static_cast<int64_t>(value >> 64)) * 0x1p64 +
         static_cast<double>(static_cast<uint64_t>(value));
}

// Coordinates are relative to the voxel that holds vertex 0. `I`: 64 bits for extents up to 2¹⁹
// units, otherwise 128.
template <class I>
struct TriangleSetup {
  int64_t origin[3];
  I p[3][3];  // vertices
  I n[3];     // (p1 − p0) × (p2 − p0)
  int major;

  VOXELD_HD explicit TriangleSetup(const Triangle& t) {
    for (int a = 0; a < 3; ++a) {
      origin[a] = VoxelOf(t.v[0][a]);
      for (int i = 0; i < 3; ++i) p[i][a] = t.v[i][a] - origin[a] * kUnitsPerVoxel;
    }
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      n[a] = (p[1][b] - p[0][b]) * (p[2][c] - p[0][c]) - (p[1][c] - p[0][c]) * (p[2][b] - p[0][b]);
    }
    major = 0;
    for (int a = 1; a < 3; ++a) {
      if (Abs(n[a]) > Abs(n[major])) major = a;
    }
  }

  // Returns the centre of a voxel on axis `a`, relative.
  VOXELD_HD I Centre(int a, int64_t voxel) const {
    return static_cast<I>(voxel - origin[a]) * kUnitsPerVoxel + kHalfVoxel;
  }

  // Returns twice the signed area of edge i → i+1 with the point (qb, qc), projected along `a`;
  // positive inside.
  VOXELD_HD I Edge(int a, int i, I qb, I qc) const {
    const int b = (a + 1) % 3, c = (a + 2) % 3, j = (i + 1) % 3;
    const I area = (p[j][b] - p[i][b]) * (qc - p[i][c]) - (p[j][c] - p[i][c]) * (qb - p[i][b]);
    return n[a] < 0 ? -area : area;
  }

  VOXELD_HD uint32_t ColorAt(const Triangle& t, const int32_t voxel[3]) const {
    if (t.IsOfOneColor()) return t.color[0];
    const int b = (major + 1) % 3, c = (major + 2) % 3;
    const I qb = Centre(b, voxel[b]), qc = Centre(c, voxel[c]);
    I weight[3], sum = 0;
    for (int i = 0; i < 3; ++i) {
      weight[i] = Max<I>(0, Edge(major, (i + 1) % 3, qb, qc));
      sum += weight[i];
    }
    uint32_t rgb = 0;
    for (int shift = 0; shift < 24; shift += 8) {
      I total = sum / 2;
      for (int i = 0; i < 3; ++i) total += weight[i] * static_cast<I>((t.color[i] >> shift) & 0xFF);
      rgb |= static_cast<uint32_t>(total / sum) << shift;
    }
    return t.texture.texels == nullptr ? rgb : Tinted(TexelAt(t, weight, sum), rgb);
  }

  VOXELD_HD static uint32_t TexelAt(const Triangle& t, const I (&weight)[3], I sum) {
    double place[2] = {0, 0};
    for (int i = 0; i < 3; ++i) {
      const double share = ToDouble(weight[i]);
      for (int k = 0; k < 2; ++k) {
        place[k] = place[k] + share * static_cast<double>(t.texture.at[i][k]);
      }
    }
    return t.texture.Texel(place[0] / ToDouble(sum), place[1] / ToDouble(sum));
  }
};

// Requires: `box` is not empty and lies within the triangle's bounds.
template <class I, class Emit>
VOXELD_HD void EmitThinAlong(const Triangle& t, const TriangleSetup<I>& s, int a, const Box3& box,
                             Emit&& emit) {
  const int b = (a + 1) % 3, c = (a + 2) % 3;
  const bool flip = s.n[a] < 0;
  const I den = Abs(s.n[a]) * kUnitsPerVoxel;
  const I nb = flip ? -s.n[b] : s.n[b], nc = flip ? -s.n[c] : s.n[c];
  const I low = static_cast<I>(box.lo[a] - s.origin[a]) * den;
  const I high = static_cast<I>(box.hi[a] - s.origin[a]) * den;
  I slope[3];  // of the edge functions, from one voxel along b to the next
  for (int i = 0; i < 3; ++i) {
    const I step = (s.p[(i + 1) % 3][c] - s.p[i][c]) * kUnitsPerVoxel;
    slope[i] = flip ? step : -step;
  }
  const I fall = -nb * kUnitsPerVoxel;
  const I qb0 = s.Centre(b, box.lo[b]);
  for (int32_t vc = box.lo[c]; vc < box.hi[c]; ++vc) {
    const I qc = s.Centre(c, vc);
    I e0 = s.Edge(a, 0, qb0, qc), e1 = s.Edge(a, 1, qb0, qc), e2 = s.Edge(a, 2, qb0, qc);
    // The depth times |n_a|.
    I depth = Abs(s.n[a]) * s.p[0][a] - nb * (qb0 - s.p[0][b]) - nc * (qc - s.p[0][c]);
    for (int32_t vb = box.lo[b]; vb < box.hi[b]; ++vb) {
      if (e0 >= 0 && e1 >= 0 && e2 >= 0 && depth >= low && depth < high) {
        int32_t voxel[3];
        voxel[a] = static_cast<int32_t>(s.origin[a] + static_cast<int64_t>(FloorDiv(depth, den)));
        voxel[b] = vb;
        voxel[c] = vc;
        emit(voxel[0], voxel[1], voxel[2], s.ColorAt(t, voxel));
      }
      e0 += slope[0], e1 += slope[1], e2 += slope[2];
      depth += fall;
    }
  }
}

// A separating axis: edge × coordinate axis, as f = u·q_b + w·q_c with the range in which a voxel's
// centre must lie.
template <class I>
struct EdgeSlab {
  I u, w, low, high;

  VOXELD_HD EdgeSlab(const TriangleSetup<I>& s, int a, int i) {
    const int b = (a + 1) % 3, c = (a + 2) % 3, j = (i + 1) % 3, k = (i + 2) % 3;
    u = -(s.p[j][c] - s.p[i][c]);
    w = s.p[j][b] - s.p[i][b];
    const I edge = u * s.p[i][b] + w * s.p[i][c], third = u * s.p[k][b] + w * s.p[k][c];
    const I r = (Abs(u) + Abs(w)) * kHalfVoxel;
    low = Min(edge, third) - r;
    high = Max(edge, third) + r;
  }
  VOXELD_HD bool Meets(I qb, I qc) const {
    const I f = u * qb + w * qc;
    return f >= low && f <= high;
  }
};

template <class I, class Emit>
VOXELD_HD void EmitCover(const Triangle& t, const TriangleSetup<I>& s, const Box3& box,
                         Emit&& emit) {
  const int a = s.major, b = (a + 1) % 3, c = (a + 2) % 3;
  const EdgeSlab<I> slabs[3][3] = {{{s, a, 0}, {s, a, 1}, {s, a, 2}},
                                   {{s, b, 0}, {s, b, 1}, {s, b, 2}},
                                   {{s, c, 0}, {s, c, 1}, {s, c, 2}}};
  const bool flip = s.n[a] < 0;
  const I na = Abs(s.n[a]), nb = flip ? -s.n[b] : s.n[b], nc = flip ? -s.n[c] : s.n[c];
  const I r = (na + Abs(nb) + Abs(nc)) * kHalfVoxel;
  for (int32_t vc = box.lo[c]; vc < box.hi[c]; ++vc) {
    const I qc = s.Centre(c, vc);
    for (int32_t vb = box.lo[b]; vb < box.hi[b]; ++vb) {
      const I qb = s.Centre(b, vb);
      if (!slabs[0][0].Meets(qb, qc) || !slabs[0][1].Meets(qb, qc) || !slabs[0][2].Meets(qb, qc)) {
        continue;
      }
      // −r ≤ n·(q − p0) ≤ r gives the centres q_a = 256·i + 128 whose boxes meet the plane.
      const I rest = nb * (qb - s.p[0][b]) + nc * (qc - s.p[0][c]) - na * (s.p[0][a] - kHalfVoxel);
      const I first = CeilDiv<I>(-r - rest, na * kUnitsPerVoxel) + s.origin[a];
      const I last = FloorDiv<I>(r - rest, na * kUnitsPerVoxel) + s.origin[a];
      const int32_t begin = static_cast<int32_t>(Clamp<I>(first, box.lo[a], box.hi[a]));
      const int32_t end = static_cast<int32_t>(Clamp<I>(last + 1, box.lo[a], box.hi[a]));
      for (int32_t va = begin; va < end; ++va) {
        const I qa = s.Centre(a, va);
        bool meets = true;
        for (int i = 0; i < 3 && meets; ++i) {
          meets = slabs[1][i].Meets(qc, qa) && slabs[2][i].Meets(qa, qb);
        }
        if (!meets) continue;
        int32_t voxel[3];
        voxel[a] = va;
        voxel[b] = vb;
        voxel[c] = vc;
        emit(voxel[0], voxel[1], voxel[2], s.ColorAt(t, voxel));
      }
    }
  }
}

// Returns the longest edge, as a line.
VOXELD_HD VOXELD_DEVICE_NOINLINE inline Line LongestEdge(const Triangle& t) {
  int longest = 0;
  Wide greatest = -1;
  for (int i = 0; i < 3; ++i) {
    Wide sum = 0;
    for (int a = 0; a < 3; ++a) {
      const Wide d = t.v[(i + 1) % 3][a] - t.v[i][a];
      sum += d * d;
    }
    if (sum > greatest) greatest = sum, longest = i;
  }
  const int next = (longest + 1) % 3;
  return {t.v[longest], t.v[next], t.ColorOfCorner(longest), t.ColorOfCorner(next),
          t.rule == SurfaceRule::kThin ? LineSampling::kThin : LineSampling::kCover};
}

// Emits the inner voxels of a triangle with an area. Returns false if it has no area. Requires:
// `part` is not empty and lies within the triangle's bounds.
template <class I, class Emit>
VOXELD_HD VOXELD_DEVICE_NOINLINE bool EmitArea(const Triangle& t, const Box3& part, Emit emit) {
  const TriangleSetup<I> setup(t);
  if (setup.n[0] == 0 && setup.n[1] == 0 && setup.n[2] == 0) return false;
  if (t.rule == SurfaceRule::kCover) {
    EmitCover(t, setup, part, emit);
    return true;
  }
  for (int a = 0; a < 3; ++a) {
    if (setup.n[a] != 0) EmitThinAlong(t, setup, a, part, emit);
  }
  return true;
}

VOXELD_HD inline int64_t Extent(const Triangle& t) {
  int64_t extent = 0;
  for (int a = 0; a < 3; ++a) {
    const int64_t low = Min(t.v[0][a], Min(t.v[1][a], t.v[2][a]));
    const int64_t high = Max(t.v[0][a], Max(t.v[1][a], t.v[2][a]));
    extent = Max(extent, high - low);
  }
  return extent;
}

// narrow: TriangleSetup's products fit in 64 bits.
template <class Emit>
VOXELD_HD void EmitTriangle(const Triangle& t, const Box3& box, bool narrow, Emit&& emit) {
  const Box3 part = Intersect(box, BoundsOf(t));
  if (IsEmpty(part)) return;
  const bool has_area = narrow ? EmitArea<int64_t>(t, part, emit) : EmitArea<Wide>(t, part, emit);
  if (has_area && t.rule == SurfaceRule::kCover) return;
  if (!has_area) EmitLine(LongestEdge(t), box, emit);
  for (int i = 0; i < 3; ++i) EmitVoxelOf(t.v[i], t.ColorOfCorner(i), box, emit);
}

template <class Emit>
VOXELD_HD void EmitTriangle(const Triangle& t, const Box3& box, Emit&& emit) {
  constexpr int64_t kNarrow = int64_t{1} << 19;
  EmitTriangle(t, box, Extent(t) <= kNarrow, emit);
}

}  // namespace voxeld::gpu
