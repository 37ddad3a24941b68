// Thick triangles: all voxels whose centre lies within a radius of a (closed) triangle, including
// its edges and corners, in voxel space. A triangle without area is a segment or a point.
//
// Evaluated in IEEE double, in the order written here, from differences of positions, which are
// exact: a shift by whole voxels shifts the result. Vertices are sorted lexicographically, so that
// any order of them gives the same voxels.
//
// Colour: the colour of the triangle at the place nearest to the voxel's centre. Its weights are
// computed in double and rounded to the nearest of 255 for each channel, halves up; with a texture
// it is multiplied by the texel there. Of places equally near on two edges, the one on the first
// edge counts. If several triangles cover a voxel, as on both sides of an edge that they share, its
// word is the greatest, as everywhere. (The voxels of the thin triangle, which are drawn as well,
// have their colours by triangle.h: at their centres, as seen along an axis.)
#pragma once

#include "gpu/primitives/capsule.h"
#include "gpu/primitives/fixed.h"
#include "gpu/primitives/triangle.h"

namespace voxeld::gpu {

// The vectors to a point from the three corners of a thick triangle, in units.
struct FromCorners {
  double w[3][3];

  VOXELD_HD FromCorners Moved(int axis, double units) const {
    FromCorners moved = *this;
    for (auto& w_i : moved.w) w_i[axis] += units;  // whole numbers
    return moved;
  }
};

struct ThickTriangle {
  Triangle triangle;  // its vertices in lexicographic order
  double radius;      // units, a whole number
  double edge[3][3];  // from corner i to the next, units
  double length2[3];  // of edges
  double normal[3];
  double normal2;     // |normal|²; 0: it has no area
  double side[3][3];  // across edge i, to the inside

  // Requires: `radius` is in units, at least 1.
  VOXELD_HD static ThickTriangle Of(const Triangle& t, int64_t radius) {
    ThickTriangle thick;
    thick.triangle = Ordered(t);
    thick.radius = static_cast<double>(radius);
    constexpr int64_t kNarrow = int64_t{1} << 30;  // up to here the normal fits 64 bits
    if (Extent(t) <= kNarrow) {
      thick.SetNormal<int64_t>();
    } else {
      thick.SetNormal<Wide>();
    }
    thick.normal2 = Dot(thick.normal, thick.normal);
    for (int i = 0; i < 3; ++i) {
      for (int a = 0; a < 3; ++a) {
        thick.edge[i][a] =
            static_cast<double>(thick.triangle.v[(i + 1) % 3][a] - thick.triangle.v[i][a]);
      }
      thick.length2[i] = Dot(thick.edge[i], thick.edge[i]);
      Cross(thick.normal, thick.edge[i], thick.side[i]);
    }
    return thick;
  }

  // Returns the vectors to the centre of a voxel, or to the point `units` beyond its lower corner.
  VOXELD_HD FromCorners Seen(int64_t x, int64_t y, int64_t z, int64_t units = kHalfVoxel) const {
    const int64_t p[3] = {x, y, z};
    FromCorners seen;
    for (int i = 0; i < 3; ++i) {
      for (int a = 0; a < 3; ++a) {
        seen.w[i][a] = static_cast<double>(p[a] * kUnitsPerVoxel + units - triangle.v[i][a]);
      }
    }
    return seen;
  }

  // Returns whether a point lies within `r` of the triangle.
  VOXELD_HD bool Within(const FromCorners& at, double r) const {
    bool above = normal2 > 0;
    for (int i = 0; i < 3; ++i) above = above && !IsBeyond(at, i);
    if (above) {
      const double height = Dot(normal, at.w[0]);
      return height * height <= r * r * normal2;
    }
    for (int i = 0; i < 3; ++i) {
      if (normal2 > 0 && !IsBeyond(at, i)) continue;
      if (IsNearSegment(at.w[i], edge[i], length2[i], r)) return true;
    }
    return false;
  }

  VOXELD_HD uint32_t ColorAt(const FromCorners& at) const {
    if (triangle.IsOfOneColor()) return triangle.color[0];
    double weight[3];
    const double sum = Weigh(at, weight);
    uint32_t rgb = 0;
    for (int shift = 0; shift < 24; shift += 8) {
      double channel[3];
      for (int i = 0; i < 3; ++i) {
        channel[i] = static_cast<double>((triangle.color[i] >> shift) & 0xFF);
      }
      rgb |= static_cast<uint32_t>(FloorToInt(Dot(weight, channel) / sum + 0.5)) << shift;
    }
    if (triangle.texture.texels == nullptr) return rgb;
    double place[2];
    for (int k = 0; k < 2; ++k) {
      double on_picture[3];
      for (int i = 0; i < 3; ++i) on_picture[i] = static_cast<double>(triangle.texture.at[i][k]);
      place[k] = Dot(weight, on_picture) / sum;
    }
    return Tinted(triangle.texture.Texel(place[0], place[1]), rgb);
  }

 private:
  VOXELD_HD static double Dot(const double a[3], const double b[3]) {
    return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
  }
  VOXELD_HD static void Cross(const double a[3], const double b[3], double c[3]) {
    for (int i = 0; i < 3; ++i) {
      c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    }
  }

  VOXELD_HD static Triangle Ordered(const Triangle& t) {
    Triangle ordered = t;
    const auto sort = [&](int i, int j) {
      if (!LexicographicallyLess(ordered.v[j], ordered.v[i])) return;
      Swap(ordered.v[i], ordered.v[j]);
      Swap(ordered.color[i], ordered.color[j]);
      for (int k = 0; k < 2; ++k) Swap(ordered.texture.at[i][k], ordered.texture.at[j][k]);
    };
    sort(0, 1);
    sort(1, 2);
    sort(0, 1);
    return ordered;
  }
  template <class T>
  VOXELD_HD static void Swap(T& a, T& b) {
    const T kept = a;
    a = b;
    b = kept;
  }

  // Exact, except for its conversion.
  template <class I>
  VOXELD_HD void SetNormal() {
    const TriangleSetup<I> setup(triangle);
    for (int a = 0; a < 3; ++a) {
      normal[a] = setup.n[a] < 0 ? -ToDouble(-setup.n[a]) : ToDouble(setup.n[a]);
    }
  }

  // Returns whether the point is outside edge i, as seen along the normal.
  VOXELD_HD bool IsBeyond(const FromCorners& at, int i) const { return Dot(side[i], at.w[i]) < 0; }

  // Computes the weights of the corners at the nearest place; returns their sum, which is not 0.
  VOXELD_HD double Weigh(const FromCorners& at, double weight[3]) const {
    bool above = normal2 > 0;
    for (int i = 0; i < 3; ++i) above = above && !IsBeyond(at, i);
    if (above) {
      for (int i = 0; i < 3; ++i) weight[i] = Dot(side[(i + 1) % 3], at.w[(i + 1) % 3]);
      const double sum = (weight[0] + weight[1]) + weight[2];
      if (sum > 0) return sum;
    }
    double nearest = -1, sum = 1;
    for (int i = 0; i < 3; ++i) {
      if (normal2 > 0 && !above && !IsBeyond(at, i)) continue;
      const int j = (i + 1) % 3;
      const double along = Dot(at.w[i], edge[i]);
      double square;
      if (along <= 0) {
        square = Dot(at.w[i], at.w[i]);
      } else if (along >= length2[i]) {
        square = Dot(at.w[j], at.w[j]);
      } else {
        double across[3];
        Cross(at.w[i], edge[i], across);
        square = Dot(across, across) / length2[i];
      }
      if (nearest >= 0 && !(square < nearest)) continue;
      nearest = square;
      weight[0] = weight[1] = weight[2] = 0;
      weight[i] = along <= 0 ? 1 : (along >= length2[i] ? 0 : length2[i] - along);
      weight[j] = along <= 0 ? 0 : (along >= length2[i] ? 1 : along);
      sum = weight[i] + weight[j];
    }
    return sum;
  }
};

// Emits the voxels of a thick triangle, without its thin voxels.
template <class Emit>
VOXELD_HD VOXELD_DEVICE_NOINLINE void EmitThick(const Triangle& t, int64_t radius, const Box3& box,
                                                Emit emit) {
  // Skips blocks of 4³ voxels whose middle is farther from the triangle than any of their centres
  // can be from their middle: 1.5·√3 voxels and a margin.
  constexpr int32_t kBlock = 4;
  constexpr double kReach = 720;
  const Box3 b = Intersect(box, BoundsOf(t, radius));
  if (IsEmpty(b)) return;
  const ThickTriangle thick = ThickTriangle::Of(t, radius);
  for (int32_t z0 = b.lo[2]; z0 < b.hi[2]; z0 += kBlock) {
    for (int32_t y0 = b.lo[1]; y0 < b.hi[1]; y0 += kBlock) {
      for (int32_t x0 = b.lo[0]; x0 < b.hi[0]; x0 += kBlock) {
        const FromCorners middle = thick.Seen(x0, y0, z0, kBlock / 2 * kUnitsPerVoxel);
        if (!thick.Within(middle, thick.radius + kReach)) continue;
        const int32_t x1 = Min(b.hi[0], x0 + kBlock);
        const int32_t y1 = Min(b.hi[1], y0 + kBlock);
        const int32_t z1 = Min(b.hi[2], z0 + kBlock);
        for (int32_t z = z0; z < z1; ++z) {
          for (int32_t y = y0; y < y1; ++y) {
            FromCorners at = thick.Seen(x0, y, z);
            for (int32_t x = x0; x < x1; ++x) {
              if (thick.Within(at, thick.radius)) emit(x, y, z, thick.ColorAt(at));
              at = at.Moved(0, kUnitsPerVoxel);
            }
          }
        }
      }
    }
  }
}

}  // namespace voxeld::gpu
