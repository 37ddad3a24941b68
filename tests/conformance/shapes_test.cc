// Compares shapes given by their measures with their distances in double precision, voxel by voxel,
// on every engine: the contents of a solid; how near a shell must come and how far it may extend;
// that no path leads through a surface; that a shift by whole voxels shifts the result. Their
// volumes: volumes_test.cc.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gpu/primitives/arrow.h"
#include "gpu/primitives/cone.h"
#include "gpu/primitives/disc.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/parallelepiped.h"
#include "gpu/primitives/patch.h"
#include "gpu/primitives/polygon.h"
#include "gpu/primitives/torus.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace shapes_test {

using implicit::FieldShape;
using implicit::Graph;
using implicit::Vector;

constexpr int32_t kSize = 44;
constexpr double kHalfDiagonal = 0.8660254037844386;
constexpr double kMargin = 6e-3;  // voxels: origins are snapped to 2⁻⁸ voxel

struct Case {
  std::string name;
  std::function<FieldShape(Graph&)> make;
  // The signed distance of a point, in the shape's units; sets `edge` where the nearest place is an
  // edge, along which shells are mitred. For a surface without an inside, the distance without a
  // sign.
  std::function<double(const Vector& p, bool& edge)> distance;
  bool solid = true;  // whether it has an inside
  bool exact = true;  // whether the distance is exact, not only its sign
};

double Norm(const Vector& v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

// For spheres along a line: the greatest depth in any of them, found by a fine search.
double CapsuleDistance(const Vector& p, const Vector& a, const Vector& b, double ra, double rb) {
  const auto at = [&](double t) { return Norm(p - (a + t * (b - a))) - (ra + t * (rb - ra)); };
  int best = 0;
  constexpr int kSteps = 64;
  for (int i = 1; i <= kSteps; ++i) {
    if (at(i / double{kSteps}) < at(best / double{kSteps})) best = i;
  }
  double lo = std::max(0, best - 1) / double{kSteps},
         hi = std::min(kSteps, best + 1) / double{kSteps};
  for (int i = 0; i < 60; ++i) {  // convex in t
    const double m1 = lo + (hi - lo) / 3, m2 = hi - (hi - lo) / 3;
    (at(m1) < at(m2) ? hi : lo) = at(m1) < at(m2) ? m2 : m1;
  }
  return at((lo + hi) / 2);
}

// For a convex polygon in the plane, counter-clockwise; its first edge is the axis, which does not
// count as an edge.
double SectionDistance(double across, double along,
                       const std::vector<std::array<double, 2>>& points, bool& edge) {
  double nearest = std::numeric_limits<double>::infinity();
  bool inside = true;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto& a = points[i];
    const auto& b = points[(i + 1) % points.size()];
    const double dx = b[0] - a[0], dy = b[1] - a[1], length2 = dx * dx + dy * dy;
    if (dx * (along - a[1]) - dy * (across - a[0]) < 0) inside = false;
    if (i == 0 || length2 == 0) continue;
    const double t = std::clamp(((across - a[0]) * dx + (along - a[1]) * dy) / length2, 0.0, 1.0);
    const double d = std::hypot(across - a[0] - t * dx, along - a[1] - t * dy);
    if (d < nearest) edge = t == 0 || t == 1;
    nearest = std::min(nearest, d);
  }
  return inside ? -nearest : nearest;
}

double Along(const Vector& p, const Vector& a, const Vector& unit) {
  return implicit::Dot(p - a, unit);
}

std::vector<Case> Cases() {
  std::vector<Case> cases;
  const Ellipsoid ellipsoid{{0.1, -0.2, 0.3}, {14, 9, 6}};
  cases.push_back({"ellipsoid", [=](Graph& g) { return ellipsoid.Make(g); },
                   [=](const Vector& p, bool&) {
                     double sum = 0;
                     for (int a = 0; a < 3; ++a)
                       sum += std::pow((p[a] - ellipsoid.center[a]) / ellipsoid.radii[a], 2);
                     return (std::sqrt(sum) - 1) * 6;
                   },
                   true, false});
  const Torus torus{{0.2, 0.1, -0.3}, 11, 4};
  cases.push_back({"torus", [=](Graph& g) { return torus.Make(g); },
                   [=](const Vector& p, bool&) {
                     const Vector d = p - torus.center;
                     return std::hypot(std::hypot(d.x, d.y) - 11, d.z) - 4;
                   }});
  const Cone capsule{{-6, -5, -4}, {7, 6, 5}, 7, 3, true};
  cases.push_back({"capsule", [=](Graph& g) { return capsule.Make(g); },
                   [=](const Vector& p, bool&) {
                     return CapsuleDistance(p, capsule.start, capsule.end, 7, 3);
                   }});
  for (const double end_radius : {0.0, 4.0, 9.0}) {
    const Cone cone{{-3, -7, -8}, {2, 5, 9}, 9, end_radius, false};
    const double length = Norm(cone.end - cone.start);
    const Vector unit = 1 / length * (cone.end - cone.start);
    cases.push_back(
        {"cone to " + std::to_string(end_radius), [=](Graph& g) { return cone.Make(g); },
         [=](const Vector& p, bool& edge) {
           const double along = Along(p, cone.start, unit);
           const double across = Norm(p - (cone.start + along * unit));
           return SectionDistance(across, along,
                                  {{0, length}, {0, 0}, {9, 0}, {end_radius, length}}, edge);
         }});
  }
  const Parallelepiped box{{0, 0.5, -0.5}, {{16, 2, 0}, {-3, 14, 4}, {2, -3, 18}}};
  cases.push_back({"parallelepiped", [=](Graph& g) { return box.Make(g); },
                   [=](const Vector& p, bool& edge) {
                     // The distance from the faces; a place that is beyond one face and past
                     // another is nearest to an edge.
                     double most = -std::numeric_limits<double>::infinity();
                     int beyond = 0;
                     for (int a = 0; a < 3; ++a) {
                       const Vector n =
                           implicit::Cross(box.edges[(a + 1) % 3], box.edges[(a + 2) % 3]);
                       const double d = std::fabs(implicit::Dot(n, p - box.center)) / Norm(n) -
                                        std::fabs(implicit::Dot(n, box.edges[a])) / Norm(n) / 2;
                       beyond += d > -2.5;
                       most = std::max(most, d);
                     }
                     edge = beyond > 1;
                     return most;
                   }});
  const Disc disc{{0.3, 0.2, 0.1}, {1, 2, 3}, 15, 6};
  const Vector up = 1 / Norm(disc.normal) * disc.normal;
  const auto flat = [](double height, double outside) {
    return std::hypot(height, std::max(0.0, outside));
  };
  cases.push_back({"disc", [=](Graph& g) { return disc.Make(g); },
                   [=](const Vector& p, bool& edge) {
                     const double height = Along(p, disc.center, up);
                     const double radial = Norm(p - disc.center - height * up);
                     const double outside = std::max(radial - 15, 6 - radial);
                     edge = outside > -2.5;
                     return flat(height, outside);
                   },
                   false});
  const Patch patch{{-10, -9, 3}, {20, 4, -6}, {-2, 18, 5}};
  cases.push_back({"patch", [=](Graph& g) { return patch.Make(g); },
                   [=](const Vector& p, bool& edge) {
                     const Vector n = implicit::Cross(patch.u, patch.v);
                     const Vector d = p - patch.corner;
                     const double area2 = implicit::Dot(n, n);
                     const double s = implicit::Dot(n, implicit::Cross(d, patch.v)) / area2;
                     const double t = implicit::Dot(n, implicit::Cross(patch.u, d)) / area2;
                     const double outside = 15 * std::max(std::max(-s, s - 1), std::max(-t, t - 1));
                     edge = outside > -2.5;
                     return flat(implicit::Dot(n, d) / Norm(n), outside);
                   },
                   false});
  return cases;
}

class MeasuredShapes : public EngineConformance {
 protected:
  MeasuredShapes() : engine_(Make({.threads = 1, .inline_execution = true})) {
    EXPECT_TRUE(engine_.SetTarget(CubeTarget(kSize)).ok());
  }
  std::vector<uint32_t> Draw(const FieldShape& shape, Graph& graph, GeometryRecord record,
                             const Affine& map) {
    ModelGeometry g;
    implicit::ProgramSource source{.surface = shape.surface, .bound = shape.bound};
    source.ring_ends = shape.ring_ends;
    source.ring_axis = shape.ring_axis;
    g.indices = *implicit::Compile(graph, source);
    g.positions = shape.ring_points;
    g.record = record;
    g.record.id = 1;
    g.record.kind = PrimitiveKind::kImplicit;
    g.record.index_count = static_cast<uint32_t>(g.indices.size());
    g.record.vertex_count = static_cast<uint32_t>(g.positions.size() / 3);
    g.record.params[6] = 1;
    for (int a = 0; a < 3; ++a) {
      g.record.params[a] = static_cast<float>(shape.min[a]);
      g.record.params[3 + a] = static_cast<float>(shape.max[a]);
    }
    DeltaBuffer delta;
    delta.PutWhole(SceneOf(g, map));
    EXPECT_TRUE(engine_.Apply(delta).ok());
    EXPECT_EQ(engine_.Frame().status(), absl::OkStatus());
    return engine_.Voxels();
  }
  // Returns a rotation about an axis, a uniform scale, and the origin in the middle.
  static Affine Placed(SceneGenerator& random, double scale) {
    Vector axis{random.Real(-1, 1), random.Real(-1, 1), random.Real(0.1, 1)};
    axis = 1 / Norm(axis) * axis;
    const double angle = random.Real(0, 6), c = std::cos(angle), s = std::sin(angle);
    Affine map;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        double m = axis[row] * axis[column] * (1 - c) + (row == column ? c : 0);
        if (row != column) {
          const int k = 3 - row - column;
          m += ((column - row + 3) % 3 == 1 ? -s : s) * axis[k];
        }
        map.m[row * 4 + column] = m * scale;
      }
      map.m[row * 4 + 3] = kSize / 2 + random.Real(-1, 1);
    }
    return map;
  }
  // Maps a voxel's centre back: the map is a rotation and a scale.
  static Vector Back(const Affine& map, int32_t x, int32_t y, int32_t z, double scale) {
    const double d[3] = {x + 0.5 - map.m[3], y + 0.5 - map.m[7], z + 0.5 - map.m[11]};
    double q[3];
    for (int column = 0; column < 3; ++column) {
      q[column] = (map.m[column] * d[0] + map.m[4 + column] * d[1] + map.m[8 + column] * d[2]) /
                  (scale * scale);
    }
    return {q[0], q[1], q[2]};
  }
  EngineDriver engine_;
};

size_t At(int32_t x, int32_t y, int32_t z) {
  return (static_cast<size_t>(z) * kSize + static_cast<size_t>(y)) * kSize + static_cast<size_t>(x);
}

// Returns the dark voxels that steps from the grid's corner reach: across faces, or in any
// direction.
std::vector<uint8_t> Flood(const std::vector<uint32_t>& voxels, bool any) {
  std::vector<uint8_t> reached(voxels.size());
  std::vector<std::array<int32_t, 3>> open = {{0, 0, 0}};
  reached[0] = 1;
  while (!open.empty()) {
    const auto [x, y, z] = open.back();
    open.pop_back();
    for (int n = 0; n < 27; ++n) {
      const int32_t dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
      if (!any && std::abs(dx) + std::abs(dy) + std::abs(dz) != 1) continue;
      const std::array<int32_t, 3> to = {x + dx, y + dy, z + dz};
      if (std::any_of(to.begin(), to.end(), [](int32_t c) { return c < 0 || c >= kSize; }))
        continue;
      const size_t at = At(to[0], to[1], to[2]);
      if (voxels[at] != 0 || reached[at] != 0) continue;
      reached[at] = 1;
      open.push_back(to);
    }
  }
  return reached;
}

TEST_P(MeasuredShapes, AreAsFarAsTheyAreSaidToBe) {
  const uint64_t seed = SeedOr(9000);
  uint64_t judged = 0, lit = 0;
  for (uint64_t i = 0; i < 2; ++i) {
    for (const Case& c : Cases()) {
      SceneGenerator random(seed + i);
      SCOPED_TRACE(c.name + ", VOXELD_SEED=" + std::to_string(seed + i));
      const double scale = random.Real(0.8, 1.0);
      const Affine map = Placed(random, scale);
      for (const bool solid : {true, false}) {
        if (solid && !c.solid) continue;
        Graph graph;
        const FieldShape shape = c.make(graph);
        GeometryRecord record;
        record.fill = solid ? Fill::kSolid : Fill::kSurface;
        record.rule = static_cast<SurfaceRule>(i % 2);
        record.thickness = solid ? 0 : static_cast<float>(random.Chance(0.5) ? 3 : 1.5);
        const std::vector<uint32_t> voxels = Draw(shape, graph, record, map);
        const double half = record.thickness / 2.0;
        for (int32_t z = 0; z < kSize; ++z) {
          for (int32_t y = 0; y < kSize; ++y) {
            for (int32_t x = 0; x < kSize; ++x) {
              bool edge = false;
              const double d = c.distance(Back(map, x, y, z, scale), edge) * scale;
              const bool drawn = voxels[At(x, y, z)] != 0;
              lit += drawn;
              if (solid ? std::fabs(d) < kMargin : edge || !c.exact) continue;
              ++judged;
              if (solid) {
                ASSERT_EQ(drawn, d < 0) << "voxel (" << x << ", " << y << ", " << z << ") at " << d;
              } else if (std::fabs(d) < half - kMargin) {
                ASSERT_TRUE(drawn) << "voxel (" << x << ", " << y << ", " << z << ") at " << d;
              } else if (std::fabs(d) > half + kHalfDiagonal + kMargin) {
                ASSERT_FALSE(drawn) << "voxel (" << x << ", " << y << ", " << z << ") at " << d;
              }
            }
          }
        }
      }
    }
  }
  EXPECT_GT(judged, 500'000u);
  EXPECT_GT(lit, 50'000u);
}

TEST_P(MeasuredShapes, NothingGetsThroughTheirSurfaces) {
  for (const Case& c : Cases()) {
    if (!c.solid) continue;
    for (const float thickness : {0.0F, 0.5F}) {
      for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
        SCOPED_TRACE(c.name);
        SceneGenerator random(77);
        const double scale = 0.9;
        const Affine map = Placed(random, scale);
        Graph graph;
        const FieldShape shape = c.make(graph);
        GeometryRecord record;
        record.rule = rule;
        record.thickness = thickness;
        const std::vector<uint32_t> voxels = Draw(shape, graph, record, map);
        const std::vector<uint8_t> outside = Flood(voxels, rule == SurfaceRule::kCover);
        uint64_t inside = 0;
        for (int32_t z = 0; z < kSize; ++z) {
          for (int32_t y = 0; y < kSize; ++y) {
            for (int32_t x = 0; x < kSize; ++x) {
              bool edge = false;
              const double d = c.distance(Back(map, x, y, z, scale), edge) * scale;
              if (d > -1.5) continue;
              ++inside;
              ASSERT_EQ(outside[At(x, y, z)], 0) << "(" << x << ", " << y << ", " << z << ")";
            }
          }
        }
        EXPECT_GT(inside, 100u);
      }
    }
  }
}

TEST_P(MeasuredShapes, NothingGetsIntoAnArrow) {
  const Arrow arrow{{-9, -8, -7}, {9, 8, 7}, 4, 12, 9};
  const Vector unit = 1 / Norm(arrow.end - arrow.start) * (arrow.end - arrow.start);
  const double length = Norm(arrow.end - arrow.start);
  for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
    SceneGenerator random(78);
    const Affine map = Placed(random, 1);
    Graph graph;
    const std::vector<uint32_t> voxels = Draw(arrow.Make(graph), graph, {.rule = rule}, map);
    const std::vector<uint8_t> outside = Flood(voxels, rule == SurfaceRule::kCover);
    uint64_t inside = 0;
    for (int32_t z = 0; z < kSize; ++z) {
      for (int32_t y = 0; y < kSize; ++y) {
        for (int32_t x = 0; x < kSize; ++x) {
          const Vector p = Back(map, x, y, z, 1);
          const double along = Along(p, arrow.start, unit);
          const double across = Norm(p - (arrow.start + along * unit));
          const bool shaft = along > 2 && along < length - 12 && across < 2;
          const double left = length - along;  // distance to the tip
          const bool head = left > 2 && left < 10 && across < left * 0.75 - 2.5;
          if (!shaft && !head) continue;
          ++inside;
          ASSERT_EQ(outside[At(x, y, z)], 0) << "(" << x << ", " << y << ", " << z << ")";
        }
      }
    }
    EXPECT_GT(inside, 300u);
  }
}

TEST_P(MeasuredShapes, AShiftByWholeVoxelsShiftsThem) {
  for (const Case& c : Cases()) {
    SCOPED_TRACE(c.name);
    SceneGenerator random(5);
    Affine map = Placed(random, 0.7);
    const int32_t by[3] = {3, -2, 1};
    std::vector<uint32_t> drawn[2];
    for (std::vector<uint32_t>& voxels : drawn) {
      Graph graph;
      const FieldShape shape = c.make(graph);
      GeometryRecord record;
      record.thickness = 1;
      voxels = Draw(shape, graph, record, map);
      for (int a = 0; a < 3; ++a) map.m[a * 4 + 3] += by[a];
    }
    uint64_t lit = 0;
    for (int32_t z = 5; z < kSize - 5; ++z) {
      for (int32_t y = 5; y < kSize - 5; ++y) {
        for (int32_t x = 5; x < kSize - 5; ++x) {
          lit += drawn[0][At(x, y, z)] != 0;
          ASSERT_EQ(drawn[0][At(x, y, z)], drawn[1][At(x + by[0], y + by[1], z + by[2])]);
        }
      }
    }
    EXPECT_GT(lit, 100u);
  }
}

// Shapes smaller than a voxel are still drawn, and not much larger than one voxel.
TEST_P(MeasuredShapes, TinyOnesAreNotLost) {
  const Cone needle{{-8, -8, -8}, {8, 7, 6}, 0.01, 0.01, true};
  const Torus wire{{0, 0, 0}, 10, 0.01};
  const Ellipsoid dust{{0, 0, 0}, {0.01, 0.01, 0.01}};
  const std::pair<std::function<FieldShape(Graph&)>, uint64_t> cases[] = {
      {[&](Graph& g) { return needle.Make(g); }, 16},
      {[&](Graph& g) { return wire.Make(g); }, 56},
      {[&](Graph& g) { return dust.Make(g); }, 1}};
  for (const auto& [make, least] : cases) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      SceneGenerator random(seed);
      Graph graph;
      const FieldShape shape = make(graph);
      GeometryRecord record;
      record.fill = Fill::kSolid;
      const uint64_t lit = CountLit(Draw(shape, graph, record, Placed(random, 1)));
      EXPECT_GE(lit, least);
      EXPECT_LE(lit, least * 5);
    }
  }
}

// Every voxel beyond the edge of a flat cone or of a disc is dark, at every height.
TEST_P(MeasuredShapes, FlatOnesEndAtTheirRadii) {
  struct Flat {
    std::function<FieldShape(Graph&)> make;
    double least, most;  // from the axis
    float thickness;
    Fill fill;
  };
  const Cone plate{{0, 0, 0}, {0, 0, 0.2}, 10, 0, false};
  const Disc ring{{0, 0, 0}, {0, 0, 1}, 12, 4};
  const Flat cases[] = {{[&](Graph& g) { return plate.Make(g); }, 0, 10, 0, Fill::kSolid},
                        {[&](Graph& g) { return ring.Make(g); }, 4, 12, 6, Fill::kSurface}};
  for (const Flat& flat : cases) {
    Graph graph;
    const FieldShape shape = flat.make(graph);
    GeometryRecord record;
    record.fill = flat.fill;
    record.thickness = flat.thickness;
    Affine map;
    for (int a = 0; a < 3; ++a) map.m[a * 4 + 3] = kSize / 2 + 0.5;
    const std::vector<uint32_t> voxels = Draw(shape, graph, record, map);
    EXPECT_GT(CountLit(voxels), 200u);
    for (int32_t z = 0; z < kSize; ++z) {
      for (int32_t y = 0; y < kSize; ++y) {
        for (int32_t x = 0; x < kSize; ++x) {
          const double across = std::hypot(x - kSize / 2, y - kSize / 2);
          if (voxels[At(x, y, z)] == 0) continue;
          EXPECT_LE(across, flat.most + 1e-3) << x << ", " << y << ", " << z;
          EXPECT_GE(across, flat.least - 1e-3) << x << ", " << y << ", " << z;
        }
      }
    }
  }
}

TEST_P(MeasuredShapes, PolygonsHaveHoles) {
  std::vector<Vector> points;
  for (const double size : {16.0, 8.0}) {
    for (const auto& [x, y] :
         std::vector<std::pair<double, double>>{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
      points.push_back({x * size, y * size, 0.25 * x * size});
    }
  }
  const std::vector<uint32_t> ends = {4, 8};
  const Polygon polygon{points, ends};
  Graph graph;
  const FieldShape shape = polygon.Make(graph);
  EXPECT_EQ(shape.ring_axis, 2u);
  Affine map;
  for (int a = 0; a < 3; ++a) map.m[a * 4 + 3] = kSize / 2;
  const std::vector<uint32_t> voxels = Draw(shape, graph, {}, map);
  for (int32_t y = 0; y < kSize; ++y) {
    for (int32_t x = 0; x < kSize; ++x) {
      const double u = x + 0.5 - kSize / 2, v = y + 0.5 - kSize / 2;
      const double reach = std::max(std::fabs(u), std::fabs(v));
      uint64_t lit = 0;
      for (int32_t z = 0; z < kSize; ++z) lit += voxels[At(x, y, z)] != 0;
      EXPECT_EQ(lit > 0, reach < 16 && reach > 8) << x << ", " << y;
      EXPECT_LE(lit, 2u);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Engines, MeasuredShapes, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

}  // namespace shapes_test
}  // namespace voxeld::gpu::conformance
