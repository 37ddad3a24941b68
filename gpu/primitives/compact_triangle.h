// Triangles of less than 64 voxels' extent, within ±2¹⁴ voxels, in 32 bytes: the same voxels and
// colours as triangle.h's, region by region of 32×32×16 voxels and row by row, in 32-bit arithmetic
// and doubles that hold whole numbers.
//
// Vertices are kept in units relative to the voxel of vertex 0. With an extent E ≤ 2¹⁴ − 256 all
// of them are below 2¹⁴, and they are less than 2¹⁴ + 2⁸ away from the centre of any voxel in the
// bounds, so that normals and edge functions are below 2²⁹·⁵.
//
// Sides. In the projection along an axis, a triangle of normal n_a ≠ 0 consists of the points on
// the inner side of its three edges: edge functions ≥ 0, with the sign of n_a. A square of one
// voxel meets it if their bounds meet and each edge function, raised by half a voxel's extent along
// the edge's normal, is ≥ 0 at its centre: if two convex sets are apart, an edge of one of them
// separates them. triangle.h bounds each of the nine functions on both sides; together with the
// bounds, both tests mean that the projections meet. If n_a = 0 the projection is a piece of a line
// that contains all edges, and any of them bounds it on both sides.
//
// Depths. ⌊x / d⌋ of whole numbers is ⌊(x + ½) / d⌋, whose argument is at least ½/d from any whole
// number. Here |x| < 2⁴⁶, so x + ½ and its sums are exact in double, and the rounded product with
// 1/d has an error less than |x|·2⁻⁵²/d < ½/d. ⌈x / d⌉ is ⌊(x − 1) / d⌋ + 1.
#pragma once

#include <cstdint>

#include "gpu/primitives/triangle.h"

namespace voxeld::gpu {

// 32 bytes, read as two times 16 bytes.
struct alignas(16) CompactTriangle {
  static constexpr int64_t kMostExtent = (int64_t{1} << 14) - kUnitsPerVoxel;
  static constexpr int64_t kMostUnits = int64_t{1} << 22;
  // Flags.
  static constexpr uint32_t kCover = 1;
  static constexpr uint32_t kFlat = 2;   // without area
  static constexpr uint32_t kMixed = 4;  // its vertices' colours differ

  // By axis, 16 bits each: the vertices, and the voxel of the first one.
  uint32_t corners[3][2];
  uint32_t word;  // gpu/word.h; of several colours, that of vertex 0; 0: draws nothing
  uint32_t flags;
};

// Returns whether all triangles whose vertices lie in such a box of positions (in voxels, closed),
// and are at most `extent` apart on each axis, can be compact.
VOXELD_HD inline bool AreCompact(const double lo[3], const double hi[3], const double extent[3]) {
  for (int a = 0; a < 3; ++a) {
    if (!(lo[a] > -16383.0 && hi[a] < 16383.0 && extent[a] < 62.9)) return false;
  }
  return true;
}

VOXELD_HD inline bool IsCompact(const Triangle& t) {
  for (int a = 0; a < 3; ++a) {
    for (int i = 0; i < 3; ++i) {
      if (Abs(t.v[i][a]) > CompactTriangle::kMostUnits) return false;
    }
  }
  return Extent(t) <= CompactTriangle::kMostExtent;
}

// Requires: the triangle IsCompact. `mixed`: its colours matter, and differ.
VOXELD_HD inline CompactTriangle MakeCompact(const Triangle& t, uint32_t word, bool mixed) {
  CompactTriangle c;
  int32_t p[3][3];
  for (int a = 0; a < 3; ++a) {
    const int64_t origin = VoxelOf(t.v[0][a]);
    for (int i = 0; i < 3; ++i) {
      p[i][a] = static_cast<int32_t>(t.v[i][a] - origin * kUnitsPerVoxel);
    }
    c.corners[a][0] = static_cast<uint32_t>(p[0][a] & 0xFFFF) | static_cast<uint32_t>(p[1][a])
                                                                    << 16;
    c.corners[a][1] = static_cast<uint32_t>(p[2][a] & 0xFFFF) | static_cast<uint32_t>(origin) << 16;
  }
  bool area = false;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, d = (a + 2) % 3;
    area |= (p[1][b] - p[0][b]) * (p[2][d] - p[0][d]) != (p[1][d] - p[0][d]) * (p[2][b] - p[0][b]);
  }
  c.word = word;
  c.flags = (t.rule == SurfaceRule::kCover ? CompactTriangle::kCover : 0) |
            (area ? 0 : CompactTriangle::kFlat) | (mixed ? CompactTriangle::kMixed : 0);
  return c;
}

// The vertices on one axis, and the voxel to which they are relative.
struct CompactAxis {
  int32_t p[3], origin;

  // Reads the vertices of any axis, without indexed memory accesses.
  VOXELD_HD static CompactAxis Of(const CompactTriangle& t, int a) {
    const uint32_t low = a == 0 ? t.corners[0][0] : a == 1 ? t.corners[1][0] : t.corners[2][0];
    const uint32_t high = a == 0 ? t.corners[0][1] : a == 1 ? t.corners[1][1] : t.corners[2][1];
    return {{static_cast<int16_t>(low & 0xFFFF), static_cast<int32_t>(low) >> 16,
             static_cast<int16_t>(high & 0xFFFF)},
            static_cast<int32_t>(high) >> 16};
  }
  // The bounds of the voxels that the triangle may cover, relative, half-open.
  VOXELD_HD int32_t lo(uint32_t flags) const {
    return (Min(p[0], Min(p[1], p[2])) - ((flags & CompactTriangle::kCover) != 0 ? 1 : 0)) >> 8;
  }
  VOXELD_HD int32_t hi() const { return (Max(p[0], Max(p[1], p[2])) >> 8) + 1; }
};

// Returns component a of the normal, from the two axes that follow a.
VOXELD_HD inline int32_t CompactNormal(const CompactAxis& b, const CompactAxis& c) {
  return (b.p[1] - b.p[0]) * (c.p[2] - c.p[0]) - (c.p[1] - c.p[0]) * (b.p[2] - b.p[0]);
}

// Returns the original triangle, with the given colours.
VOXELD_HD inline Triangle TriangleOf(const CompactTriangle& t, const uint32_t color[3]) {
  Triangle wide;
  for (int a = 0; a < 3; ++a) {
    const CompactAxis axis = CompactAxis::Of(t, a);
    for (int i = 0; i < 3; ++i) {
      wide.v[i][a] = axis.p[i] + static_cast<int64_t>(axis.origin) * kUnitsPerVoxel;
    }
  }
  for (int i = 0; i < 3; ++i) wide.color[i] = color[i];
  wide.rule = (t.flags & CompactTriangle::kCover) != 0 ? SurfaceRule::kCover : SurfaceRule::kThin;
  return wide;
}

// The part of a triangle's bounds that lies in a region, and how many rows of it have to be
// visited.
struct CompactPart {
  int32_t lo[3], hi[3];  // voxels relative to the triangle's
  int32_t base;          // the index of the triangle's voxel, as if it were in the region
  int32_t rows[3];       // along each axis; a flat triangle has one

  // The index of a voxel in its region is x | y << 5 | z << 10.
  VOXELD_HD static int32_t Stride(int a) { return 1 << (5 * a); }

  // at: coordinates of the region's first voxel.
  VOXELD_HD static CompactPart Of(const CompactTriangle& t, const int32_t at[3]) {
    CompactPart part;
    part.base = 0;
    CompactAxis axes[3];
    bool some = true;
    for (int a = 0; a < 3; ++a) {
      axes[a] = CompactAxis::Of(t, a);
      part.lo[a] = Max(axes[a].lo(t.flags), at[a] - axes[a].origin);
      part.hi[a] = Min(axes[a].hi(), at[a] - axes[a].origin + (a == 2 ? 16 : 32));
      part.base += (axes[a].origin - at[a]) * Stride(a);
      some &= part.lo[a] < part.hi[a];
    }
    int32_t n[3], major = 0;
    for (int a = 0; a < 3; ++a) {
      n[a] = Abs(CompactNormal(axes[(a + 1) % 3], axes[(a + 2) % 3]));
      part.rows[a] = part.hi[(a + 2) % 3] - part.lo[(a + 2) % 3];
    }
    if (n[1] > n[0]) major = 1;
    if (n[2] > Max(n[0], n[1])) major = 2;
    const bool cover = (t.flags & CompactTriangle::kCover) != 0;
    const bool flat = (t.flags & CompactTriangle::kFlat) != 0;
    for (int a = 0; a < 3; ++a) {
      if (flat) part.rows[a] = a == 0 ? 1 : 0;
      if (!flat && (cover ? a != major : n[a] == 0)) part.rows[a] = 0;
      if (!some) part.rows[a] = 0;
    }
    return part;
  }
  VOXELD_HD int32_t row_count() const { return rows[0] + rows[1] + rows[2]; }
  // Returns the index in the region of a voxel that is given relative to the triangle's.
  VOXELD_HD int32_t PlaceOf(int32_t x, int32_t y, int32_t z) const {
    return base + x * Stride(0) + y * Stride(1) + z * Stride(2);
  }
  VOXELD_HD bool Has(int32_t x, int32_t y, int32_t z) const {
    return x >= lo[0] && x < hi[0] && y >= lo[1] && y < hi[1] && z >= lo[2] && z < hi[2];
  }
};

// Selects a component by the number of its axis.
VOXELD_HD inline int32_t PickAxis(const int32_t v[3], int a) {
  return a == 0 ? v[0] : a == 1 ? v[1] : v[2];
}

// In the projection along an axis: three functions of a voxel that are ≥ 0 inside the triangle.
struct CompactSides {
  int32_t at[3], step_b[3], step_c[3];  // at one voxel; to the next along either axis

  // b and c: the axes that follow; n: the normal's component. Evaluates the functions at voxel (vb,
  // vc), relative. `kCover`: they are ≥ 0 where the voxel meets the triangle, instead of the
  // voxel's centre.
  template <bool kCover>
  VOXELD_HD static CompactSides Of(const CompactAxis& b, const CompactAxis& c, int32_t n,
                                   int32_t vb, int32_t vc) {
    CompactSides s;
    const int32_t qb = vb * 256 + 128, qc = vc * 256 + 128;
    for (int i = 0; i < 3; ++i) {
      const int j = i == 2 ? 0 : i + 1;
      int32_t db = b.p[j] - b.p[i], dc = c.p[j] - c.p[i];
      if (n < 0) db = -db, dc = -dc;
      s.at[i] = db * (qc - c.p[i]) - dc * (qb - b.p[i]);
      s.step_b[i] = -dc * 256;
      s.step_c[i] = db * 256;
    }
    if constexpr (kCover) {
      if (n == 0) {
        // Use edge 0, or edge 1 if edge 0 has no length here, from both sides.
        const bool first = s.step_b[0] != 0 || s.step_c[0] != 0;
        s.at[0] = first ? s.at[0] : s.at[1];
        s.step_b[0] = first ? s.step_b[0] : s.step_b[1];
        s.step_c[0] = first ? s.step_c[0] : s.step_c[1];
        s.at[1] = -s.at[0], s.step_b[1] = -s.step_b[0], s.step_c[1] = -s.step_c[0];
        s.at[2] = s.step_b[2] = s.step_c[2] = 0;
      }
      for (int i = 0; i < 3; ++i) s.at[i] += (Abs(s.step_b[i]) + Abs(s.step_c[i])) / 2;
    }
    return s;
  }
  VOXELD_HD bool inside() const { return (at[0] | at[1] | at[2]) >= 0; }
  VOXELD_HD void NextB() {
    for (int i = 0; i < 3; ++i) at[i] += step_b[i];
  }
};

// Requires: |x| < 2³¹.
VOXELD_HD inline int32_t FloorOf(double x) {
#if defined(__CUDA_ARCH__)
  return __double2int_rd(x);
#else
  return static_cast<int32_t>(FloorToInt(x));
#endif
}

// Calls f(place) for each voxel of one row of columns along axis a, at vc on its axis c.
template <class F>
VOXELD_HD void EmitCompactThinRow(const CompactTriangle& t, const CompactPart& part, int a,
                                  int32_t row, F&& f) {
  const int b = a == 2 ? 0 : a + 1, c = a == 0 ? 2 : a - 1;
  const CompactAxis along_a = CompactAxis::Of(t, a), along_b = CompactAxis::Of(t, b),
                    along_c = CompactAxis::Of(t, c);
  const int32_t na = CompactNormal(along_b, along_c);
  const int32_t lo_b = PickAxis(part.lo, b), width = PickAxis(part.hi, b) - lo_b;
  const int32_t vc = PickAxis(part.lo, c) + row;
  CompactSides sides = CompactSides::Of<false>(along_b, along_c, na, lo_b, vc);
  int32_t outside = 0;
  for (int i = 0; i < 3; ++i) outside |= sides.at[i] + Max(0, sides.step_b[i] * (width - 1));
  if (outside < 0) return;
  // The depth times |n_a|.
  const int32_t sign = na < 0 ? -1 : 1;
  const int32_t nb = CompactNormal(along_c, along_a) * sign;
  const int32_t nc = CompactNormal(along_a, along_b) * sign;
  const int64_t first = static_cast<int64_t>(na * sign) * along_a.p[0] -
                        static_cast<int64_t>(nb) * (lo_b * 256 + 128 - along_b.p[0]) -
                        static_cast<int64_t>(nc) * (vc * 256 + 128 - along_c.p[0]);
  double depth = static_cast<double>(first) + 0.5;
  const double fall = static_cast<double>(nb) * -256.0;
  const double inverse = 1.0 / (static_cast<double>(na * sign) * 256.0);
  const int32_t lo_a = PickAxis(part.lo, a), size_a = PickAxis(part.hi, a) - lo_a;
  const int32_t step = CompactPart::Stride(b), stride = CompactPart::Stride(a);
  int32_t place = part.base + vc * CompactPart::Stride(c) + lo_b * step;
  for (int32_t i = 0; i < width; ++i, place += step) {
    if (sides.inside()) {
      const int32_t va = FloorOf(depth * inverse);
      if (static_cast<uint32_t>(va - lo_a) < static_cast<uint32_t>(size_a)) f(place + va * stride);
    }
    sides.NextB();
    depth += fall;
  }
}

// The same for a triangle that is drawn with COVER; a is the axis of the normal's greatest
// component.
template <class F>
VOXELD_HD void EmitCompactCoverRow(const CompactTriangle& t, const CompactPart& part, int a,
                                   int32_t row, F&& f) {
  const int b = a == 2 ? 0 : a + 1, c = a == 0 ? 2 : a - 1;
  const CompactAxis along_a = CompactAxis::Of(t, a), along_b = CompactAxis::Of(t, b),
                    along_c = CompactAxis::Of(t, c);
  const int32_t na = CompactNormal(along_b, along_c), nb = CompactNormal(along_c, along_a),
                nc = CompactNormal(along_a, along_b);
  const int32_t lo_a = PickAxis(part.lo, a), hi_a = PickAxis(part.hi, a);
  const int32_t lo_b = PickAxis(part.lo, b), width = PickAxis(part.hi, b) - lo_b;
  const int32_t vc = PickAxis(part.lo, c) + row;
  CompactSides sides = CompactSides::Of<true>(along_b, along_c, na, lo_b, vc);
  int32_t outside = 0;
  for (int i = 0; i < 3; ++i) outside |= sides.at[i] + Max(0, sides.step_b[i] * (width - 1));
  if (outside < 0) return;
  const CompactSides from_b = CompactSides::Of<true>(along_c, along_a, nb, vc, lo_a);
  CompactSides from_c = CompactSides::Of<true>(along_a, along_b, nc, lo_a, lo_b);
  // The voxels from ⌈(−r − rest) / den⌉ to ⌊(r − rest) / den⌋ meet the plane.
  const int32_t sign = na < 0 ? -1 : 1;
  const int64_t rest = static_cast<int64_t>(nb * sign) * (lo_b * 256 + 128 - along_b.p[0]) +
                       static_cast<int64_t>(nc * sign) * (vc * 256 + 128 - along_c.p[0]) -
                       static_cast<int64_t>(na * sign) * (along_a.p[0] - 128);
  const double twice =
      (static_cast<double>(Abs(na)) + static_cast<double>(Abs(nb)) + static_cast<double>(Abs(nc))) *
      256.0;
  double top = twice / 2 - static_cast<double>(rest) + 0.5;
  const double fall = static_cast<double>(nb * sign) * -256.0;
  const double inverse = 1.0 / (static_cast<double>(na * sign) * 256.0);
  const int32_t step = CompactPart::Stride(b), stride = CompactPart::Stride(a);
  int32_t place = part.base + vc * CompactPart::Stride(c) + lo_b * step;
  for (int32_t i = 0; i < width; ++i, place += step) {
    if (sides.inside()) {
      const int32_t end = Min(hi_a, FloorOf(top * inverse) + 1);
      for (int32_t va = Max(lo_a, FloorOf((top - twice - 1.0) * inverse) + 1); va < end; ++va) {
        int32_t apart = 0;
        for (int k = 0; k < 3; ++k) {
          apart |= from_b.at[k] + from_b.step_c[k] * (va - lo_a);
          apart |= from_c.at[k] + from_c.step_b[k] * (va - lo_a);
        }
        if (apart >= 0) f(place + va * stride);
      }
    }
    sides.NextB();
    for (int k = 0; k < 3; ++k) from_c.at[k] += from_c.step_c[k];
    top += fall;
  }
}

// Calls f(place) for each voxel of row `row` of part.row_count(), for a triangle that is not flat.
template <class F>
VOXELD_HD void EmitCompactRow(const CompactTriangle& t, const CompactPart& part, int32_t row,
                              F&& f) {
  int a = 0;
  if (row >= part.rows[0]) {
    row -= part.rows[0];
    a = row < part.rows[1] ? 1 : 2;
    if (a == 2) row -= part.rows[1];
  }
  if ((t.flags & CompactTriangle::kCover) != 0) {
    EmitCompactCoverRow(t, part, a, row, f);
  } else {
    EmitCompactThinRow(t, part, a, row, f);
  }
}

// Calls f(place, vertex) for the voxels of the vertices. All triangles have them, except those with
// an area that are drawn with COVER.
template <class F>
VOXELD_HD void EmitCompactVertices(const CompactTriangle& t, const CompactPart& part, F&& f) {
  if ((t.flags & (CompactTriangle::kCover | CompactTriangle::kFlat)) == CompactTriangle::kCover) {
    return;
  }
  const CompactAxis x = CompactAxis::Of(t, 0), y = CompactAxis::Of(t, 1), z = CompactAxis::Of(t, 2);
  for (int i = 0; i < 3; ++i) {
    const int32_t vx = x.p[i] >> 8, vy = y.p[i] >> 8, vz = z.p[i] >> 8;
    if (part.Has(vx, vy, vz)) f(part.PlaceOf(vx, vy, vz), i);
  }
}

// Returns the colour of a voxel, given relative, for a triangle with an area: the same as
// TriangleSetup::ColorAt. The sum of the weights is below 2³², and totals with a half are exact in
// double.
VOXELD_HD inline uint32_t CompactColorAt(const CompactTriangle& t, const uint32_t color[3],
                                         const int32_t voxel[3]) {
  const CompactAxis x = CompactAxis::Of(t, 0), y = CompactAxis::Of(t, 1), z = CompactAxis::Of(t, 2);
  const int32_t n[3] = {CompactNormal(y, z), CompactNormal(z, x), CompactNormal(x, y)};
  int major = 0;
  if (Abs(n[1]) > Abs(n[0])) major = 1;
  if (Abs(n[2]) > Max(Abs(n[0]), Abs(n[1]))) major = 2;
  const int b = major == 2 ? 0 : major + 1, c = major == 0 ? 2 : major - 1;
  const CompactSides sides =
      CompactSides::Of<false>(CompactAxis::Of(t, b), CompactAxis::Of(t, c), PickAxis(n, major),
                              PickAxis(voxel, b), PickAxis(voxel, c));
  int64_t weight[3], sum = 0;
  for (int i = 0; i < 3; ++i) {
    weight[i] = Max(0, sides.at[i == 2 ? 0 : i + 1]);
    sum += weight[i];
  }
  uint32_t rgb = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    int64_t total = sum / 2;
    for (int i = 0; i < 3; ++i) total += weight[i] * static_cast<int64_t>(color[i] >> shift & 0xFF);
    const double mean = (static_cast<double>(total) + 0.5) / static_cast<double>(sum);
    rgb |= static_cast<uint32_t>(FloorOf(mean)) << shift;
  }
  return rgb;
}

// Calls f(x, y, z, rgb) for a flat triangle's voxels in a box inside the volume.
template <class F>
VOXELD_HD void EmitCompactFlat(const CompactTriangle& t, const uint32_t color[3], const Box3& box,
                               F&& f) {
  static_assert(CompactTriangle::kMostUnits <= kNarrowLine);
  EmitLine(LongestEdge(TriangleOf(t, color)), box, /*narrow=*/true, f);
}

}  // namespace voxeld::gpu
