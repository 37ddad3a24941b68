// Compares height maps and Bézier surfaces with a computation in double precision: distances from
// triangles by brute force, from patches by closely spaced places on them; no path leads through a
// surface.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "gpu/curves/cut.h"
#include "tests/daemon/drawn/drawn.h"

namespace voxeld::daemon::drawn {
namespace surfaces_test {

using gpu::implicit::Cross;
using gpu::implicit::Dot;
using gpu::implicit::Length;
using Corners = std::array<Vector, 3>;

constexpr int32_t kSize = 48;

double SegmentDistance(const Vector& p, const Vector& a, const Vector& b) {
  const double t = std::clamp(Dot(p - a, b - a) / Dot(b - a, b - a), 0.0, 1.0);
  return Length(p - (a + t * (b - a)));
}

// Returns how far inside its edges a point of a triangle's plane is; negative outside.
double Depth(const Vector& p, const Corners& t) {
  const Vector normal = Unit(Cross(t[1] - t[0], t[2] - t[0]));
  double depth = 1e9;
  for (size_t i = 0; i < 3; ++i) {
    const Vector& a = t[i];
    const Vector& b = t[(i + 1) % 3];
    depth = std::min(depth, Dot(Unit(Cross(normal, b - a)), p - a));
  }
  return depth;
}

double TriangleDistance(const Vector& p, const Corners& t) {
  const Vector normal = Unit(Cross(t[1] - t[0], t[2] - t[0]));
  const double height = Dot(normal, p - t[0]);
  if (Depth(p - height * normal, t) >= 0) return std::fabs(height);
  return std::min({SegmentDistance(p, t[0], t[1]), SegmentDistance(p, t[1], t[2]),
                   SegmentDistance(p, t[2], t[0])});
}

// Returns whether one of the three lines from face to face through the middle of a voxel certainly
// crosses a triangle.
bool IsCrossed(const Vector& middle, const Corners& t) {
  constexpr double kSure = 0.02;
  const Vector normal = Unit(Cross(t[1] - t[0], t[2] - t[0]));
  for (const Vector& axis : {Vector{1, 0, 0}, Vector{0, 1, 0}, Vector{0, 0, 1}}) {
    const double slope = Dot(normal, axis), height = Dot(normal, t[0] - middle);
    if (std::fabs(slope) < 0.2) continue;
    const double at = height / slope;
    if (std::fabs(at) < 0.5 - kSure / 0.2 && Depth(middle + at * axis, t) > kSure / 0.2)
      return true;
  }
  return false;
}

struct HeightMap {
  uint32_t columns = 7, rows = 6;
  Vector corner, edges[2], up;
  std::vector<double> heights;

  Vector Sample(uint32_t column, uint32_t row) const {
    return corner + column / (columns - 1.0) * edges[0] + row / (rows - 1.0) * edges[1] +
           heights[row * columns + column] * up;
  }
  std::vector<Corners> Triangles(const Placement& placed) const {
    std::vector<Corners> all;
    for (uint32_t row = 0; row + 1 < rows; ++row) {
      for (uint32_t column = 0; column + 1 < columns; ++column) {
        const auto at = [&](uint32_t c, uint32_t r) {
          return placed.Forth(Sample(column + c, row + r));
        };
        all.push_back({at(0, 0), at(1, 0), at(1, 1)});
        all.push_back({at(0, 0), at(1, 1), at(0, 1)});
      }
    }
    return all;
  }
  P Message(v1::SurfaceRule rule, bool whole) const {
    P p;
    v1::HeightMap* const map = p.mutable_height_map();
    Set(map->mutable_corner(), corner);
    Set(map->mutable_edge_a(), edges[0]);
    Set(map->mutable_edge_b(), edges[1]);
    Set(map->mutable_up(), up);
    map->set_columns(columns);
    map->set_rows(rows);
    map->set_rule(rule);
    std::string* const out = map->mutable_heights();
    if (whole) map->set_height_type(v1::ELEMENT_TYPE_U16);
    for (const double height : heights) {
      const auto number = static_cast<float>(height);
      const auto step = static_cast<uint16_t>(std::lround(height * 65535));
      if (whole) out->append(reinterpret_cast<const char*>(&step), sizeof(step));
      if (!whole) out->append(reinterpret_cast<const char*>(&number), sizeof(number));
    }
    return p;
  }
};

// Heights from 0 to 1.
HeightMap Hills() {
  HeightMap map;
  for (uint32_t i = 0; i < map.columns * map.rows; ++i)
    map.heights.push_back(std::lround(65535 * (0.5 + 0.5 * std::sin(i * i * 1.7))) / 65535.0);
  return map;
}

class DrawnSurfaces : public DrawnPrimitives {
 protected:
  DrawnSurfaces() : DrawnPrimitives(kSize) {}

  // For a surface z = f(x, y) across the whole cube: a place that is clearly above it cannot be
  // reached from below.
  void ExpectNothingGetsThrough(const P& primitive, bool cover, double doubt,
                                const std::function<double(double, double)>& f) {
    const Drawn drawn = Draw(primitive, gpu::Affine());
    ASSERT_FALSE(drawn.Lit(0, 0, 0));
    const std::vector<uint8_t> reached = drawn.Reached({0, 0, 0}, false, cover);
    uint64_t above = 0, below = 0, through = 0, lost = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const double height = z + 0.5 - f(x + 0.5, y + 0.5);
      const bool here = reached[drawn.Index(x, y, z)] != 0;
      above += height > doubt;
      through += height > doubt && here;
      below += height < -doubt;
      lost += height < -doubt && !here && !drawn.Lit(x, y, z);
    });
    EXPECT_GT(above, 10'000u);
    EXPECT_GT(below, 10'000u);
    EXPECT_EQ(through, 0u);
    EXPECT_EQ(lost, 0u);
  }
};

TEST_F(DrawnSurfaces, HeightMapsAreTheirTriangles) {
  HeightMap map = Hills();
  map.corner = {-4, -3.5, -1.5};
  map.edges[0] = {7.5, 1, 0.4};
  map.edges[1] = {-0.6, 6.5, 1};
  map.up = {0.3, -0.2, 2.5};
  const Placement placed = Placed(0.8, 4.5, kSize / 2, 0.2);
  const std::vector<Corners> triangles = map.Triangles(placed);
  for (const auto rule : {v1::SURFACE_RULE_THIN, v1::SURFACE_RULE_COVER}) {
    for (const bool whole : {false, true}) {
      const Drawn drawn = Draw(map.Message(rule, whole), placed.map);
      uint64_t lit = 0, far = 0, missing = 0;
      drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
        const Vector middle = {x + 0.5, y + 0.5, z + 0.5};
        double distance = 1e9;
        bool crossed = false, corner = false;
        for (const Corners& t : triangles) {
          if (Length(middle - t[0]) > Length(t[1] - t[0]) + Length(t[2] - t[0]) + 2) continue;
          distance = std::min(distance, TriangleDistance(middle, t));
          crossed = crossed || IsCrossed(middle, t);
          for (const Vector& v : t) {
            const Vector d = v - middle;
            corner = corner ||
                     std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)}) <= 0.5 + kSnapped;
          }
        }
        const bool cover = rule == v1::SURFACE_RULE_COVER;
        const double most = (cover || corner ? kHalfDiagonal : 0.5) + kSnapped;
        const bool must = crossed || (cover && distance < 0.5 - kSnapped);
        lit += drawn.Lit(x, y, z);
        far += drawn.Lit(x, y, z) && distance > most;
        missing += must && !drawn.Lit(x, y, z);
      });
      EXPECT_GT(lit, 1000u);
      EXPECT_EQ(far, 0u) << "rule " << rule;
      EXPECT_EQ(missing, 0u) << "rule " << rule;
    }
  }
}

TEST_F(DrawnSurfaces, NothingGetsThroughHeightMaps) {
  HeightMap map = Hills();
  map.corner = {-5, -4, 8};
  map.edges[0] = {60, 0, 0};
  map.edges[1] = {0, 58, 0};
  map.up = {0, 0, 33};
  const auto f = [&](double x, double y) {
    const double u = (x - map.corner.x) / 60 * (map.columns - 1),
                 v = (y - map.corner.y) / 58 * (map.rows - 1);
    const auto column = static_cast<uint32_t>(u), row = static_cast<uint32_t>(v);
    const double s = u - column, t = v - row;
    const auto at = [&](uint32_t c, uint32_t r) { return map.Sample(column + c, row + r).z; };
    return s > t ? at(0, 0) + s * (at(1, 0) - at(0, 0)) + t * (at(1, 1) - at(1, 0))
                 : at(0, 0) + t * (at(0, 1) - at(0, 0)) + s * (at(1, 1) - at(0, 1));
  };
  ExpectNothingGetsThrough(map.Message(v1::SURFACE_RULE_THIN, false), false, 1, f);
  ExpectNothingGetsThrough(map.Message(v1::SURFACE_RULE_COVER, false), true, 4, f);
}

double Weight(int i, double t) {
  const double chosen[] = {1, 3, 3, 1};
  return chosen[i] * std::pow(t, i) * std::pow(1 - t, 3 - i);
}
Vector PatchAt(const std::vector<Vector>& points, double u, double v) {
  Vector sum;
  for (int i = 0; i < 16; ++i)
    sum = sum + Weight(i % 4, u) * Weight(i / 4, v) * points[static_cast<size_t>(i)];
  return sum;
}

P BezierSurface(const std::vector<Vector>& points, v1::SurfaceRule rule) {
  P p;
  Set(p.mutable_bezier_surface()->mutable_vertices(), points);
  p.mutable_bezier_surface()->set_rule(rule);
  return p;
}

TEST_F(DrawnSurfaces, BezierSurfacesAreWithinTheirErrorOfTheirPatches) {
  std::vector<Vector> points;
  for (int i = 0; i < 16; ++i) {
    points.push_back({(i % 4 - 1.5) * 2.2 + 0.6 * std::sin(i * 2.0),
                      (i / 4 - 1.5) * 2 + 0.5 * std::cos(i * 3.1), 3 * std::sin(i * i * 1.3)});
  }
  const Placement placed = Placed(0.8, 5, kSize / 2, 0.2);
  constexpr double kApart = 0.25;  // in voxels, between neighbouring places
  Distances distances(kSize, 1.5);
  constexpr int kPlaces = 400;
  double apart = 0;
  for (int v = 0; v <= kPlaces; ++v) {
    Vector last;
    for (int u = 0; u <= kPlaces; ++u) {
      const Vector place = placed.Forth(PatchAt(points, u / double{kPlaces}, v / double{kPlaces}));
      distances.Add(place);
      if (u > 0) apart = std::max(apart, Length(place - last));
      last = place;
    }
  }
  EXPECT_LT(apart, kApart);
  for (const auto rule : {v1::SURFACE_RULE_THIN, v1::SURFACE_RULE_COVER}) {
    const Drawn drawn = Draw(BezierSurface(points, rule), placed.map);
    uint64_t lit = 0, far = 0, missing = 0, near = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const double d = distances.At(x, y, z);
      lit += drawn.Lit(x, y, z);
      // One of the places on a grid is at most half the diagonal of its squares away.
      far += drawn.Lit(x, y, z) &&
             d > kHalfDiagonal + gpu::kPatchError + kSnapped + kApart * kApart / 4;
      // A cube whose middle is nearer to the triangles than half a voxel meets them.
      near += rule == v1::SURFACE_RULE_COVER && d < 0.5 - gpu::kPatchError - kSnapped;
      missing += rule == v1::SURFACE_RULE_COVER && d < 0.5 - gpu::kPatchError - kSnapped &&
                 !drawn.Lit(x, y, z);
    });
    EXPECT_GT(lit, 1000u);
    EXPECT_EQ(far, 0u) << "rule " << rule;
    EXPECT_EQ(missing, 0u);
    EXPECT_EQ(near > 500, rule == v1::SURFACE_RULE_COVER);
  }
}

TEST_F(DrawnSurfaces, NothingGetsThroughBezierSurfaces) {
  // Evenly spaced along x and y: z is a function of them.
  std::vector<Vector> points;
  for (int i = 0; i < 16; ++i)
    points.push_back({-6 + 20.0 * (i % 4), -6 + 20.0 * (i / 4), 24 + 26 * std::sin(i * i * 1.9)});
  const auto f = [&](double x, double y) { return PatchAt(points, (x + 6) / 60, (y + 6) / 60).z; };
  // Triangles are at most a quarter of a voxel away, measured across; and these slope by up to 2.
  ExpectNothingGetsThrough(BezierSurface(points, v1::SURFACE_RULE_THIN), false, 2, f);
  ExpectNothingGetsThrough(BezierSurface(points, v1::SURFACE_RULE_COVER), true, 5, f);
}

}  // namespace surfaces_test
}  // namespace voxeld::daemon::drawn
