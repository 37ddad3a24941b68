// Compares thick triangles with their distances, in meshes, height maps and Bézier patches; tests
// their order, triangles without area, and colours and pictures; on every engine.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "gpu/primitives/texture.h"
#include "gpu/texture_levels.h"
#include "tests/conformance/placed.h"

namespace voxeld::gpu::conformance {
namespace thick_triangles_test {

using implicit::Dot;
using implicit::Length;

constexpr int32_t kSize = 44;
// Vertices are snapped to 2⁻⁸ voxel: each is off by at most half of that along each axis.
constexpr double kMargin = 4e-3;

struct Mesh {
  std::string name;
  std::vector<Vector> points;
  std::vector<std::array<uint32_t, 3>> triangles;
};

// Returns meshes within 12 of the origin.
std::vector<Mesh> Meshes() {
  Mesh single{"one triangle", {{-11, -7, -3}, {10, -4, 5}, {1, 11, -2}}, {{0, 1, 2}}};
  Mesh needle{"a needle", {{-11, -7, -9}, {10, 8, 9}, {10.02, 8.05, 8.9}}, {{2, 0, 1}}};
  Mesh small{"small ones", {}, {}};
  for (uint32_t i = 0; i < 90; ++i) {
    const double t = i / 3 * 2.39996, c = i % 3;
    small.points.push_back(
        {9 * std::cos(t) + c, 9 * std::sin(t) + std::sin(i * 1.7), i / 3 * 0.6 - 9 + 0.8 * c * c});
    if (i % 3 == 2) small.triangles.push_back({i - 2, i - 1, i});
  }
  Mesh map{"a grid of heights", {}, {}};
  for (uint32_t i = 0; i < 36; ++i) {
    map.points.push_back({i % 6 * 3.7 - 9, i / 6 * 3.7 - 9, 4 * std::sin(i * 1.3)});
    if (i % 6 == 5 || i >= 30) continue;
    map.triangles.push_back({i, i + 1, i + 7});
    map.triangles.push_back({i, i + 7, i + 6});
  }
  return {single, needle, small, map};
}

ModelGeometry GeometryOf(const Mesh& mesh, const GeometryRecord& look) {
  ModelGeometry g{.record = look, .positions = {}, .indices = {}, .colors = {}};
  g.record.kind = PrimitiveKind::kTriangles;
  for (const Vector& p : mesh.points) {
    for (int a = 0; a < 3; ++a) g.positions.push_back(static_cast<float>(p[a]));
  }
  for (const auto& t : mesh.triangles) g.indices.insert(g.indices.end(), t.begin(), t.end());
  g.record.vertex_count = static_cast<uint32_t>(mesh.points.size());
  g.record.index_count = static_cast<uint32_t>(g.indices.size());
  return g;
}

double SegmentDistance(const Vector& p, const Vector& a, const Vector& b) {
  const double length2 = Dot(b - a, b - a);
  const double t = length2 > 0 ? std::clamp(Dot(p - a, b - a) / length2, 0.0, 1.0) : 0;
  return Length(p - (a + t * (b - a)));
}

// The place over a triangle has coordinates in it, by the normal equations; where one of them is
// negative, an edge is nearest.
double TriangleDistance(const Vector& p, const Vector& a, const Vector& b, const Vector& c) {
  const Vector u = b - a, v = c - a, w = p - a;
  const double uu = Dot(u, u), uv = Dot(u, v), vv = Dot(v, v), wu = Dot(w, u), wv = Dot(w, v);
  const double det = uu * vv - uv * uv;
  if (det > 1e-12) {
    const double s = (wu * vv - wv * uv) / det, t = (wv * uu - wu * uv) / det;
    if (s >= 0 && t >= 0 && s + t <= 1) return Length(w - s * u - t * v);
  }
  return std::min({SegmentDistance(p, a, b), SegmentDistance(p, b, c), SegmentDistance(p, c, a)});
}

class ThickTriangles : public PlacedShapes {
 protected:
  ThickTriangles() : PlacedShapes(kSize) {}

  // Checks that the voxels are those within `radius` by `distance`, and those of the thin surface,
  // and no others; those that are at `radius` within the margin may be lit or not.
  void ExpectWithin(const Drawn& thick, const Drawn& thin, double radius, double margin,
                    const std::function<double(int32_t, int32_t, int32_t)>& distance) {
    uint64_t missing = 0, far = 0, within = 0, without_thin = 0;
    thick.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const double d = distance(x, y, z);
      const bool lit = thick.Lit(x, y, z);
      within += d < radius - margin;
      missing += (d < radius - margin || thin.Lit(x, y, z)) && !lit;
      far += d > radius + margin && !thin.Lit(x, y, z) && lit;
      without_thin += lit && !thin.Lit(x, y, z);
    });
    EXPECT_EQ(missing, 0u);
    EXPECT_EQ(far, 0u);
    EXPECT_GT(within, 20u);
    EXPECT_GT(without_thin, 10u);
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, ThickTriangles, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(ThickTriangles, AreWhatLiesWithinHalfTheirThickness) {
  const Placement placed = Placed(0.7, 0.9, kSize / 2.0, 0.3);
  for (const Mesh& mesh : Meshes()) {
    std::vector<Vector> at;
    for (const Vector& p : mesh.points) at.push_back(placed.Forth(p));
    Drawn all{kSize, std::vector<uint32_t>(size_t{kSize} * kSize * kSize)};
    std::vector<double> distance(all.rgb.size(), std::numeric_limits<double>::infinity());
    all.ForEach([&](int32_t x, int32_t y, int32_t z) {
      double& least = distance[all.Index(x, y, z)];
      for (const auto& [a, b, c] : mesh.triangles) {
        least = std::min(least,
                         TriangleDistance(Vector{x + 0.5, y + 0.5, z + 0.5}, at[a], at[b], at[c]));
      }
    });
    for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      const Drawn thin = Draw(GeometryOf(mesh, {.rule = rule}), placed.map);
      for (const bool units : {false, true}) {
        for (const float thickness : {1.9F, 5.0F}) {
          SCOPED_TRACE(mesh.name + ", thickness " + std::to_string(thickness) +
                       (units ? " units" : " voxels"));
          GeometryRecord look{.rule = rule, .thickness = thickness};
          if (units) look.thickness_unit = ThicknessUnit::kUnits;
          const double radius = static_cast<double>(thickness) / 2 * (units ? 0.9 : 1);
          ExpectWithin(
              Draw(GeometryOf(mesh, look), placed.map), thin, radius, kMargin,
              [&](int32_t x, int32_t y, int32_t z) { return distance[all.Index(x, y, z)]; });
        }
      }
    }
  }
}

// A patch whose control points make it a part of a plane or of a parabolic cylinder, z = x²/20.
TEST_P(ThickTriangles, OfPatchesAreAboutWhatLiesWithinHalfTheirThickness) {
  const Placement placed = Placed(0.4, 1, kSize / 2.0, 0.2);
  for (const double bend : {0.0, 1.0 / 20}) {
    ModelGeometry g;
    g.record.kind = PrimitiveKind::kPatches;
    // For x from −12 to 12, with evenly spaced control points; those of x² come from its polar
    // form.
    for (int v = 0; v < 4; ++v) {
      for (int u = 0; u < 4; ++u) {
        const double polar[] = {144, -48, -48, 144};
        g.positions.insert(g.positions.end(),
                           {static_cast<float>(u * 8 - 12), static_cast<float>(v * 6 - 9),
                            static_cast<float>(bend * polar[u])});
      }
    }
    g.record.vertex_count = 16;
    const Drawn thin = Draw(g, placed.map);
    g.record.thickness = 6;
    // Its triangles are at most a quarter of a voxel away from it.
    ExpectWithin(Draw(g, placed.map), thin, 3, bend > 0 ? 0.25 + kMargin : kMargin,
                 [&](int32_t x, int32_t y, int32_t z) {
                   const Vector p = placed.Back(x, y, z);
                   double least = std::numeric_limits<double>::infinity();
                   for (int i = 0; i <= 480; ++i) {
                     const double at = i / 20.0 - 12;
                     least = std::min(least, std::hypot(p.x - at, p.z - bend * at * at,
                                                        std::max(0.0, std::fabs(p.y) - 9)));
                   }
                   return least;
                 });
  }
}

TEST_P(ThickTriangles, HaveTheSameVoxelsFromEachOrderOfTheirCorners) {
  const Placement placed = Placed(1.1, 1.05, kSize / 2.0, 0.4);
  const GeometryRecord look{.thickness = 3.3F};
  const Mesh mesh = Meshes()[2];
  const Drawn first = Draw(GeometryOf(mesh, look), placed.map);
  for (const std::array<int, 3>& order :
       {std::array{0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}) {
    Mesh turned = mesh;
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
      for (size_t c = 0; c < 3; ++c)
        turned.triangles[i][c] = mesh.triangles[i][static_cast<size_t>(order[c])];
    }
    EXPECT_TRUE(Draw(GeometryOf(turned, look), placed.map).rgb == first.rgb);
  }
}

// Collinear corners give the thick segment between the outer ones, coincident corners a thick
// point.
TEST_P(ThickTriangles, WithoutAreaAreSegmentsAndPoints) {
  const Affine map = Placed(0, 1, kSize / 2.0, 0.25).map;
  const std::vector<std::pair<Vector, Vector>> ends = {
      {{-9, -5, -3}, {8, 6, 4}}, {{2, 8, 4}, {2, -7, 4}}, {{1, 2, 3}, {1, 2, 3}}};
  for (const auto& [from, to] : ends) {
    const Vector middle = from + 0.5 * (to - from);
    for (const Mesh& mesh :
         {Mesh{"", {from, to, middle}, {{0, 1, 2}}}, Mesh{"", {from, to, from}, {{0, 1, 2}}},
          Mesh{"", {from, middle, to}, {{1, 0, 2}}}}) {
      const Drawn flat = Draw(GeometryOf(mesh, {.thickness = 5}), map);
      ModelGeometry line;
      line.record.kind = PrimitiveKind::kSegments;
      line.record.thickness = 5;
      for (const Vector& p : {from, to}) {
        for (int a = 0; a < 3; ++a) line.positions.push_back(static_cast<float>(p[a]));
      }
      line.record.vertex_count = 2;
      EXPECT_TRUE(flat.rgb == Draw(line, map).rgb);
      EXPECT_GT(CountLit(flat.rgb), 50u);
    }
  }
}

// Over the middle of an edge, half of each end's colour, whatever the height; beyond a corner, the
// corner's colour.
TEST_P(ThickTriangles, HaveTheColoursOfTheNearestPlace) {
  ModelGeometry g =
      GeometryOf({"", {{8, 8, 20.5}, {32, 8, 20.5}, {8, 32, 20.5}}, {{0, 1, 2}}}, {.thickness = 9});
  g.record.color_mode = ColorMode::kPerVertex;
  g.colors = {0xFF0000, 0x00FF00, 0x0000FF};
  const Drawn drawn = Draw(g, Affine());
  for (const int32_t z : {16, 18, 20, 22, 24}) {
    EXPECT_EQ(drawn.At(7, 7, z), 0xFF0000u) << z;  // beyond a corner
    EXPECT_EQ(drawn.At(33, 7, z), 0x00FF00u) << z;
    EXPECT_EQ(drawn.At(7, 33, z), 0x0000FFu) << z;
    // 11.5 of 24 from the first to the second, and 0.5 of 24 to the third.
    EXPECT_EQ(drawn.At(19, 8, z), 0x807A05u) << z;
    // Beyond the edge between these two: the colour is that at (19.5, 8).
    EXPECT_EQ(drawn.At(19, 6, z), 0x857A00u) << z;
    // A third of each is at (16, 16): here 8.5 of 24 from either.
    EXPECT_EQ(drawn.At(16, 16, z), 0x4A5A5Au) << z;
  }
  EXPECT_EQ(drawn.At(16, 16, 15), 0u);
  EXPECT_EQ(drawn.At(16, 16, 25), 0u);
}

TEST_P(ThickTriangles, TakePicturesThroughAllTheirThickness) {
  constexpr uint32_t kWide = 8, kHigh = 5;
  ModelGeometry g;
  g.record.id = 1;
  g.record.kind = PrimitiveKind::kTriangles;
  g.record.color = 0xFFFFFF;
  g.record.thickness = 7;
  g.record.vertex_count = 3;
  g.record.texture_width = kWide;
  g.record.texture_height = kHigh;
  g.positions = {2, 2, 20.5, 82, 2, 20.5, 2, 82, 20.5};
  for (const float place : {0.f, 0.f, 2.f, 0.f, 0.f, 2.f}) {
    g.colors.push_back(std::bit_cast<uint32_t>(place));
  }
  std::vector<uint32_t> texels(TexelCount(kWide, kHigh));
  const auto color = [](int32_t column, int32_t row) {
    return 0x102030u + static_cast<uint32_t>(column) * 0x090000 +
           static_cast<uint32_t>(row) * 0x000700;
  };
  for (int32_t i = 0; i < static_cast<int32_t>(kWide * kHigh); ++i)
    texels[static_cast<size_t>(i)] = color(i % 8, i / 8);
  FillLevels(kWide, kHigh, texels);
  g.colors.insert(g.colors.end(), texels.begin(), texels.end());
  const Drawn drawn = Draw(g, Affine());
  uint64_t wrong = 0;
  for (int32_t z = 17; z <= 23; ++z) {
    for (int32_t y = 2; y < 42; ++y) {
      for (int32_t x = 2; x < 42; ++x)
        wrong += drawn.At(x, y, z) != color((x - 2) / 5, (y - 2) / 8);
    }
  }
  EXPECT_EQ(wrong, 0u);
  // Beyond a side, the texels along it continue.
  EXPECT_EQ(drawn.At(0, 20, 20), color(0, 2));
  EXPECT_EQ(drawn.At(20, 1, 21), color(3, 0));
  EXPECT_EQ(drawn.At(20, 20, 16), 0u);
}

// Many thick and many thin ones at once equal the oracle's; then the thick ones become thinner.
TEST_P(ThickTriangles, AmongThinOnesEqualTheOracle) {
  SceneGenerator random(SeedOr(31));
  Target target = CubeTarget(40);
  SceneModel scene;
  scene.layers[1].id = 1;
  for (uint64_t id = 1; id <= 4; ++id) {
    ModelGeometry& g = scene.geometries[id];
    g.record.id = id;
    g.record.kind = PrimitiveKind::kTriangles;
    g.record.rule = static_cast<SurfaceRule>(id % 2);
    g.record.color_mode = ColorMode::kPerVertex;
    g.record.thickness = id > 2 ? 0.0F : 2.5F;
    for (uint32_t i = 0; i < 120; ++i) {
      double at[3];
      for (double& p : at) p = random.Real(-4, 44);
      for (int corner = 0; corner < 3; ++corner) {
        for (const double p : at) g.positions.push_back(static_cast<float>(p + random.Real(-4, 4)));
        g.colors.push_back(static_cast<uint32_t>(random.Int(0, 0xFFFFFF)));
      }
    }
    g.record.vertex_count = 360;
    scene.drawables[id] = {.id = id, .geometry = id, .layer = 1, .priority = 3};
  }
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  DeltaBuffer whole;
  whole.PutWhole(scene);
  ASSERT_TRUE(engine.Apply(whole).ok());
  ExpectLikeOracle(engine, scene, target);
  DeltaBuffer thinner;
  for (uint64_t id = 1; id <= 2; ++id) {
    ModelGeometry& g = scene.geometries[id + 4] = scene.geometries[id];
    g.record.id = id + 4;
    g.record.thickness = id == 1 ? 1.1F : 0.001F;  // the second one rounds to zero units
    thinner.Put(g);
    scene.drawables[id].geometry = id + 4;
    thinner.Put(scene.drawables[id]);
  }
  ASSERT_TRUE(engine.Apply(thinner).ok());
  ExpectLikeOracle(engine, scene, target);
}

}  // namespace thick_triangles_test
}  // namespace voxeld::gpu::conformance
