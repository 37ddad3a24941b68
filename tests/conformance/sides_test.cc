// For any expression: wherever it has different signs at the centres of neighbouring voxels, one of
// the two is lit, whatever the thickness, so that no path leads through the surface. Signs are
// computed in double precision.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "gpu/implicit/graph.h"
#include "gpu/implicit/program.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

using implicit::Graph;
using Point = std::array<double, 3>;

constexpr int32_t kSide = 36;

struct Expression {
  std::string name;
  std::function<Graph::Node(Graph&)> make;
  std::function<double(const Point&)> value;
};

// Returns expressions that are smooth, have edges, or have jumps.
std::vector<Expression> Expressions() {
  return {
      {"gyroid",
       [](Graph& g) {
         Graph::Node sum = g.Constant(0);
         for (int a = 0; a < 3; ++a) {
           const Graph::Node wave = g.Constant(0.4);
           sum = g.Add(
               sum, g.Mul(g.Sin(g.Mul(wave, g.Axis(a))), g.Cos(g.Mul(wave, g.Axis((a + 1) % 3)))));
         }
         return sum;
       },
       [](const Point& p) {
         double sum = 0;
         for (size_t a = 0; a < 3; ++a) {
           sum += std::sin(0.4 * p[a]) * std::cos(0.4 * p[(a + 1) % 3]);
         }
         return sum;
       }},
      {"two cubes, combined",
       [](Graph& g) {
         const auto cube = [&](double at) {
           const auto from = [&](int a) { return g.Abs(g.Sub(g.Axis(a), g.Constant(at))); };
           return g.Sub(g.Max(g.Max(from(0), from(1)), from(2)), g.Constant(5.3));
         };
         return g.SmoothMin(cube(-4), cube(4), g.Constant(2));
       },
       [](const Point& p) {
         const auto cube = [&](double at) {
           return std::max({std::fabs(p[0] - at), std::fabs(p[1] - at), std::fabs(p[2] - at)}) -
                  5.3;
         };
         const double a = cube(-4), b = cube(4), h = std::max(2 - std::fabs(a - b), 0.0) / 2;
         return std::min(a, b) - h * h * 2 / 4;
       }},
      {"steps",
       [](Graph& g) {
         return g.Sub(g.Axis(2), g.Mul(g.Constant(3), g.Floor(g.Mul(g.Constant(0.2), g.Axis(0)))));
       },
       [](const Point& p) { return p[2] - 3 * std::floor(0.2 * p[0]); }},
  };
}

// Returns a rotation about two axes, with 0.9 voxels a unit.
Affine Turned() {
  const double c = std::cos(0.43), s = std::sin(0.43), k = std::cos(0.7), t = std::sin(0.7);
  const double turn[9] = {c, -s * k, s * t, s, c * k, -c * t, 0, t, k};
  Affine map;
  for (int i = 0; i < 9; ++i) map.m[i / 3 * 4 + i % 3] = 0.9 * turn[i];
  for (int a = 0; a < 3; ++a) map.m[a * 4 + 3] = kSide / 2 + 0.25;
  return map;
}

// Returns −1 or 1; 0 where single precision may give another sign.
int SideAt(const Expression& expression, const Affine& map, const Point& voxel) {
  int side = 0;
  for (int n = 0; n < 7; ++n) {
    Point d = {voxel[0] + 0.5 - map.m[3], voxel[1] + 0.5 - map.m[7], voxel[2] + 0.5 - map.m[11]};
    if (n < 6) d[static_cast<size_t>(n / 2)] += n % 2 == 0 ? 1e-3 : -1e-3;
    Point q;
    for (size_t column = 0; column < 3; ++column) {
      q[column] = (map.m[column] * d[0] + map.m[4 + column] * d[1] + map.m[8 + column] * d[2]) /
                  (0.9 * 0.9);
    }
    const int here = expression.value(q) <= 0 ? -1 : 1;
    if (n > 0 && here != side) return 0;
    side = here;
  }
  return side;
}

class Sides : public EngineConformance {};

INSTANTIATE_TEST_SUITE_P(Engines, Sides, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Sides, OfNeighboursOnDifferentOnesOneIsLit) {
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(CubeTarget(kSide)).ok());
  const Affine map = Turned();
  const auto at = [](int32_t x, int32_t y, int32_t z) {
    return static_cast<size_t>((z * kSide + y) * kSide + x);
  };
  for (const Expression& expression : Expressions()) {
    SCOPED_TRACE(expression.name);
    std::vector<int> sides(size_t{kSide} * kSide * kSide);
    for (int32_t i = 0; i < kSide * kSide * kSide; ++i) {
      const Point voxel = {i % kSide * 1.0, i / kSide % kSide * 1.0, i / kSide / kSide * 1.0};
      sides[static_cast<size_t>(i)] = SideAt(expression, map, voxel);
    }
    Graph graph;
    ModelGeometry g;
    g.indices = *implicit::Compile(graph, {.surface = expression.make(graph)});
    g.record.id = 1;
    g.record.kind = PrimitiveKind::kImplicit;
    g.record.color = 0xFFFFFF;
    g.record.index_count = static_cast<uint32_t>(g.indices.size());
    for (const float thickness : {0.0F, 0.3F, 2.0F}) {
      for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
        g.record.thickness = thickness;
        g.record.rule = rule;
        DeltaBuffer delta;
        delta.PutWhole(SceneOf(g, map));
        ASSERT_TRUE(engine.Apply(delta).ok());
        ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
        const std::vector<uint32_t> voxels = engine.Voxels();
        uint64_t pairs = 0;
        for (int32_t i = 0; i < (kSide - 1) * (kSide - 2) * (kSide - 2) * 26; ++i) {
          const int32_t n = i % 26 < 13 ? i % 26 : i % 26 + 1, cell = i / 26;
          const int32_t d[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
          if (rule == SurfaceRule::kThin && d[0] * d[0] + d[1] * d[1] + d[2] * d[2] != 1) continue;
          const int32_t x = 1 + cell % (kSide - 2), y = 1 + cell / (kSide - 2) % (kSide - 2),
                        z = 1 + cell / (kSide - 2) / (kSide - 2);
          if (z > kSide - 2) break;
          const size_t here = at(x, y, z), there = at(x + d[0], y + d[1], z + d[2]);
          if (sides[here] * sides[there] != -1) continue;
          ++pairs;
          ASSERT_TRUE(voxels[here] != 0 || voxels[there] != 0)
              << "(" << x << ", " << y << ", " << z << ") and neighbour " << n << ", thickness "
              << thickness;
        }
        EXPECT_GT(pairs, 1000u);
        EXPECT_LT(CountLit(voxels), voxels.size() * 3 / 4) << "not everything is lit";
      }
    }
  }
}

}  // namespace
}  // namespace voxeld::gpu::conformance
