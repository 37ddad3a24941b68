// Compares flat shapes with their definition, places in a plane and within a rim, and ellipsoids
// and arrows with their true distances; in double precision, on every engine.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "gpu/primitives/arrow.h"
#include "gpu/primitives/disc.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/patch.h"
#include "gpu/primitives/polygon.h"
#include "tests/conformance/placed.h"

namespace voxeld::gpu::conformance {
namespace {

using implicit::Cross;
using implicit::Dot;
using implicit::Length;

constexpr int32_t kSize = 48;
constexpr double kMargin = 6e-3;  // voxels: origins are snapped to 2⁻⁸ voxel
constexpr double kRim = 2e-2;     // the same, where something lies obliquely over a rim

// The relation of a point to a flat shape: its height over the plane, and how far inside the rim it
// lies in the plane; negative outside.
struct InPlane {
  double height, depth;
};
struct FlatCase {
  std::string name;
  ModelGeometry geometry;
  std::function<InPlane(const Vector&)> at;
};

double SegmentDistance(const Vector& p, const Vector& a, const Vector& b) {
  const double t = std::clamp(Dot(p - a, b - a) / Dot(b - a, b - a), 0.0, 1.0);
  return Length(p - (a + t * (b - a)));
}

// Returns the axis that is nearest to a direction.
Vector NearestAxis(const Vector& v) {
  const double x = std::fabs(v.x), y = std::fabs(v.y), z = std::fabs(v.z);
  if (x > std::max(y, z)) return {1, 0, 0};
  return y > z ? Vector{0, 1, 0} : Vector{0, 0, 1};
}

// A point over the plane belongs to the place that it reaches in the plane along `fall`. Inside is
// decided by the even-odd rule: how often a ray in the plane meets the curves. `u` and `v` are
// orthogonal unit vectors in the plane.
InPlane InPolygon(const Vector& p, const std::vector<Vector>& points,
                  const std::vector<uint32_t>& ends, const Vector& u, const Vector& v,
                  const Vector& fall) {
  const Vector normal = Cross(u, v);
  const double height = Dot(normal, p - points[0]);
  const Vector foot = p - height / Dot(normal, fall) * fall;
  double nearest = 1e9;
  bool inside = false;
  uint32_t begin = 0;
  for (const uint32_t end : ends) {
    for (uint32_t i = begin; i < end; ++i) {
      const Vector& a = points[i];
      const Vector& b = points[i + 1 < end ? i + 1 : begin];
      nearest = std::min(nearest, SegmentDistance(foot, a, b));
      const double from = Dot(v, a - foot), to = Dot(v, b - foot);
      if ((from > 0) == (to > 0)) continue;
      const Vector crossing = a + from / (from - to) * (b - a);
      if (Dot(u, crossing - foot) > 0) inside = !inside;
    }
    begin = end;
  }
  return {height, inside ? nearest : -nearest};
}

Vector Unit(const Vector& v) { return 1 / Length(v) * v; }

std::vector<FlatCase> FlatCases(const GeometryRecord& look) {
  std::vector<FlatCase> cases;
  for (const double inner : {0.0, 6.0}) {
    const Disc disc{{0.3, 0.2, 0.1}, {1, 2, 3}, 15, inner};
    cases.push_back({inner > 0 ? "ring" : "disc", FieldGeometry(disc, look), [=](const Vector& p) {
                       const double height = Dot(Unit({1, 2, 3}), p - disc.center);
                       const double across = Length(p - disc.center - height * Unit({1, 2, 3}));
                       const double depth = 15 - across;
                       return InPlane{height, inner > 0 ? std::min(depth, across - inner) : depth};
                     }});
  }
  const Vector u = Unit({2, 1, -1}), v = Unit(Cross({1, 0, 2}, u));
  const auto polygon = [&](const std::string& name, const std::vector<std::array<double, 2>>& flat,
                           const std::vector<uint32_t>& ends) {
    std::vector<Vector> points;
    for (const auto& [x, y] : flat) points.push_back(Vector{0.2, -0.1, 0.4} + x * u + y * v);
    cases.push_back({name, FieldGeometry(Polygon{points, ends}, look), [=](const Vector& p) {
                       return InPolygon(p, points, ends, u, v, NearestAxis(Cross(u, v)));
                     }});
  };
  polygon("square with holes",
          {{-15, -14},
           {15, -15},
           {14, 15},
           {-15, 15},
           {-9, -8},
           {1, -9},
           {-4, 2},
           {4, 4},
           {11, 5},
           {9, 11}},
          {4, 7, 10});
  // A star drawn in one stroke, whose middle is outside; and a bow whose two halves have opposite
  // orientation.
  std::vector<std::array<double, 2>> star;
  for (int i = 0; i < 5; ++i)
    star.push_back({17 * std::sin(i * 2.513274123), 17 * std::cos(i * 2.513274123)});
  polygon("star", star, {5});
  polygon("bow", {{-14, -9}, {14, 8}, {13, -10}, {-15, 11}}, {4});
  // A parallelogram is a polygon of its four corners.
  const Patch patch{{-10, -9, 3}, {20, 4, -6}, {-2, 18, 5}};
  const std::vector<Vector> corners = {patch.corner, patch.corner + patch.u,
                                       patch.corner + patch.u + patch.v, patch.corner + patch.v};
  const Vector normal = Unit(Cross(patch.u, patch.v)), along = Unit(patch.u);
  cases.push_back({"patch", FieldGeometry(patch, look), [=](const Vector& p) {
                     return InPolygon(p, corners, {4}, along, Cross(normal, along), normal);
                   }});
  return cases;
}

class FlatShapes : public PlacedShapes {
 protected:
  FlatShapes() : PlacedShapes(kSize) {}
};

INSTANTIATE_TEST_SUITE_P(Engines, FlatShapes, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(FlatShapes, EndAtTheirRims) {
  for (const float thickness : {0.0F, 1.5F, 4.0F}) {
    for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      for (const FlatCase& c : FlatCases({.rule = rule, .thickness = thickness})) {
        SCOPED_TRACE(c.name + ", thickness " + std::to_string(thickness));
        const Placement placed = Placed(0.7, 0.95, kSize / 2, 0.3);
        const Drawn drawn = Draw(c.geometry, placed.map);
        const double half = thickness / 2.0;
        // A neighbour on the other side of the plane must not be nearer.
        const double most =
            std::max(half, rule == SurfaceRule::kThin ? 0.5 : kHalfDiagonal) + kMargin;
        uint64_t lit = 0, far = 0, beyond = 0, missing = 0;
        drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
          const InPlane at = c.at(placed.Back(x, y, z));
          const double height = std::fabs(at.height) * placed.scale,
                       depth = at.depth * placed.scale;
          const bool here = drawn.Lit(x, y, z);
          lit += here;
          far += here && height > most;
          beyond += here && depth < -kRim;
          missing += !here && height < half - kMargin && depth > kRim;
        });
        EXPECT_GT(lit, 100u);
        EXPECT_EQ(far, 0u);
        EXPECT_EQ(beyond, 0u);
        EXPECT_EQ(missing, 0u);
      }
    }
  }
}

// Well within the rim, no step leads through dark voxels from one side of the plane to the other.
TEST_P(FlatShapes, HaveNoHolesWithinTheirRims) {
  for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
    for (const FlatCase& c : FlatCases({.rule = rule})) {
      SCOPED_TRACE(c.name);
      const Placement placed = Placed(0.7, 0.95, kSize / 2, 0.3);
      const Drawn drawn = Draw(c.geometry, placed.map);
      uint64_t pairs = 0, holes = 0;
      drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
        const InPlane at = c.at(placed.Back(x, y, z));
        if (at.depth * placed.scale < 1 || std::fabs(at.height) > 2) return;
        if (std::fabs(at.height) < kMargin) return;
        drawn.ForEachNeighbour(
            x, y, z, rule == SurfaceRule::kCover, [&](int32_t i, int32_t j, int32_t k) {
              const InPlane to = c.at(placed.Back(i, j, k));
              if ((to.height > 0) == (at.height > 0) || std::fabs(to.height) < kMargin ||
                  to.depth * placed.scale < 1) {
                return;
              }
              ++pairs;
              holes += !drawn.Lit(x, y, z) && !drawn.Lit(i, j, k);
            });
      });
      EXPECT_GT(pairs, 100u);
      EXPECT_EQ(holes, 0u);
    }
  }
}

class RoundShapes : public PlacedShapes {
 protected:
  RoundShapes() : PlacedShapes(kSize) {}
};

INSTANTIATE_TEST_SUITE_P(Engines, RoundShapes, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

// Returns the true distance from an ellipsoid around the origin: the greatest root of Σ (r·p / (t +
// r²))² = 1 gives the nearest place, r²·p / (t + r²); found by bisection. Negative inside.
double EllipsoidDistance(const Vector& p, const Vector& radii) {
  const auto sum = [&](double t) {
    double all = 0;
    for (int a = 0; a < 3; ++a) all += std::pow(radii[a] * p[a] / (t + radii[a] * radii[a]), 2);
    return all;
  };
  const double least = std::min({radii.x, radii.y, radii.z});
  double low = -least * least, high = Length(p) * std::max({radii.x, radii.y, radii.z});
  for (int i = 0; i < 100; ++i) {
    const double middle = (low + high) / 2;
    (sum(middle) > 1 ? low : high) = middle;
  }
  double square = 0;
  for (int a = 0; a < 3; ++a)
    square += std::pow(p[a] - radii[a] * radii[a] * p[a] / (high + radii[a] * radii[a]), 2);
  return sum(0) <= 1 ? -std::sqrt(square) : std::sqrt(square);
}

TEST_P(RoundShapes, EllipsoidsShellsAreAsThickAsTheyAreSaidToBe) {
  const Vector radii = {22, 17, 12};
  for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
    for (const float thickness : {0.0F, 1.5F, 3.0F}) {
      const Placement placed = Placed(0.7, 0.95, kSize / 2, 0.3);
      const Drawn drawn = Draw(
          FieldGeometry(Ellipsoid{{}, radii}, {.rule = rule, .thickness = thickness}), placed.map);
      const double half = thickness / 2.0;
      // To first order, |P| / |∇P| is the distance: since P is convex, it is never greater than the
      // distance outside, and inside it is greater by the surface's bend.
      const double bend = half * half / (2 * placed.scale * 12 * 12 / 22);
      uint64_t lit = 0, far = 0, missing = 0;
      drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
        const double signed_distance =
            EllipsoidDistance(placed.Back(x, y, z), radii) * placed.scale;
        const double d = std::fabs(signed_distance),
                     reach = signed_distance > 0 ? half : half - bend;
        lit += drawn.Lit(x, y, z);
        far += drawn.Lit(x, y, z) && d > half + kHalfDiagonal + kMargin;
        missing += !drawn.Lit(x, y, z) && d < reach - kMargin;
      });
      EXPECT_GT(lit, 2000u);
      EXPECT_EQ(far, 0u);
      EXPECT_EQ(missing, 0u);
    }
  }
}

// Returns the distance from the outline of an arrow in the half-plane of its axis: (across, along).
double ArrowDistance(double across, double along,
                     const std::vector<std::array<double, 2>>& outline) {
  double nearest = 1e9;
  bool inside = false;
  for (size_t i = 0; i < outline.size(); ++i) {
    const auto& a = outline[i];
    const auto& b = outline[(i + 1) % outline.size()];
    if ((a[1] > along) != (b[1] > along) &&
        a[0] + (along - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > across) {
      inside = !inside;
    }
    if (i == 0) continue;  // the axis
    nearest =
        std::min(nearest, SegmentDistance({across, along, 0}, {a[0], a[1], 0}, {b[0], b[1], 0}));
  }
  return inside ? -nearest : nearest;
}

TEST_P(RoundShapes, ArrowsAreShaftsWithHeads) {
  const Arrow arrow{{-8, -12, -9}, {7, 11, 10}, 4, 13, 9};
  const Vector unit = Unit(arrow.end - arrow.start);
  const double length = Length(arrow.end - arrow.start);
  const std::vector<std::array<double, 2>> outline = {
      {0, length}, {0, 0}, {4, 0}, {4, length - 13}, {9, length - 13}};
  const Placement placed = Placed(0.7, 0.95, kSize / 2, 0.3);
  for (const float thickness : {0.0F, 1.5F, 3.0F}) {
    for (const Fill fill : {Fill::kSolid, Fill::kSurface}) {
      const Drawn drawn =
          Draw(FieldGeometry(arrow, {.fill = fill, .thickness = thickness}), placed.map);
      const double half = thickness / 2.0;
      uint64_t lit = 0, wrong = 0, far = 0;
      drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
        const Vector p = placed.Back(x, y, z);
        const double along = Dot(unit, p - arrow.start);
        const double across = Length(p - arrow.start - along * unit);
        const double d = ArrowDistance(across, along, outline) * placed.scale;
        const bool here = drawn.Lit(x, y, z);
        lit += here;
        if (fill == Fill::kSolid) {
          wrong += std::fabs(d) > kMargin && here != (d < 0);
          return;
        }
        wrong += !here && std::fabs(d) < half - kMargin;
        // Shells are mitred beyond edges: those of the head's rim, and of its tip.
        const bool rim = std::hypot(across - 9, along - (length - 13)) < 8 || along > length - 2 ||
                         std::hypot(across - 4, along) < 5;
        far += here && !rim && std::fabs(d) > half + kHalfDiagonal + kMargin;
      });
      EXPECT_GT(lit, 500u);
      EXPECT_EQ(wrong, 0u) << thickness;
      EXPECT_EQ(far, 0u) << thickness;
    }
  }
}

}  // namespace
}  // namespace voxeld::gpu::conformance
