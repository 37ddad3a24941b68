// A shift by whole voxels shifts the result, for every shape; on every engine.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "gpu/implicit/parse.h"
#include "gpu/primitives/arrow.h"
#include "gpu/primitives/cone.h"
#include "gpu/primitives/disc.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/parallelepiped.h"
#include "gpu/primitives/patch.h"
#include "gpu/primitives/polygon.h"
#include "gpu/primitives/prism.h"
#include "gpu/primitives/torus.h"
#include "tests/conformance/placed.h"

namespace voxeld::gpu::conformance {
namespace shifts_test {

constexpr int32_t kSize = 64;
constexpr int32_t kBy[3] = {17, -9, 23};

using Named = std::pair<std::string, ModelGeometry>;

void AddPoints(ModelGeometry& g, const std::vector<Vector>& points, bool colors = true) {
  for (const Vector& p : points) {
    for (int a = 0; a < 3; ++a) g.positions.push_back(static_cast<float>(p[a]));
    if (colors) g.colors.push_back(0x402010 + 0x0A1B2C * static_cast<uint32_t>(g.colors.size()));
  }
  g.record.vertex_count = static_cast<uint32_t>(points.size());
  if (colors) g.record.color_mode = ColorMode::kPerVertex;
}

// Returns places within 9 of the origin along each axis.
std::vector<Vector> Places(size_t count) {
  std::vector<Vector> points;
  for (size_t i = 0; i < count; ++i) {
    const double t = static_cast<double>(i * i + 1);
    points.push_back({9 * std::sin(1.1 * t), 9 * std::cos(1.7 * t), 9 * std::sin(2.3 * t + 1)});
  }
  return points;
}

void AddOwn(std::vector<Named>& all) {
  for (const auto& [name, kind] : {std::pair("box", PrimitiveKind::kBox),
                                   {"sphere", PrimitiveKind::kSphere},
                                   {"cylinder", PrimitiveKind::kCylinder}}) {
    for (const Fill fill : {Fill::kSolid, Fill::kSurface}) {
      ModelGeometry g{.record = {.kind = kind, .rule = SurfaceRule::kCover, .fill = fill},
                      .positions = {},
                      .indices = {},
                      .colors = {}};
      const float sizes[] = {0.3F, -0.2F, 0.4F, 8, 7.5F, 9};
      std::copy(std::begin(sizes), std::end(sizes), g.record.params);
      all.emplace_back(name, g);
    }
  }
}

void AddFields(std::vector<Named>& all) {
  for (const Fill fill : {Fill::kSolid, Fill::kSurface}) {
    const GeometryRecord look{.rule = SurfaceRule::kCover, .fill = fill, .thickness = 1.5F};
    all.emplace_back("ellipsoid", FieldGeometry(Ellipsoid{{}, {9, 7, 5}}, look));
    all.emplace_back("torus", FieldGeometry(Torus{{}, 7, 2.5}, look));
    all.emplace_back("capsule", FieldGeometry(Cone{{-3, -4, -3}, {4, 3, 4}, 4, 2, true}, look));
    all.emplace_back("parallelepiped",
                     FieldGeometry(Parallelepiped{{}, {{9, 1, 0}, {2, 8, 1}, {0, 3, 9}}}, look));
    all.emplace_back("arrow", FieldGeometry(Arrow{{-6, -5, -4}, {6, 5, 4}, 1, 5, 3}, look));
    const std::vector<Vector> corners = {{-8, -7, -2},  {8, -6, 2},      {7, 8, 1.75},
                                         {-6, 7, -1.5}, {-3, -3, -0.75}, {3, -2, 0.75},
                                         {0, 4, 0}};
    const std::vector<uint32_t> ends = {4, 7};
    all.emplace_back("prism", FieldGeometry(Prism{corners, ends, 6}, look));
    if (fill == Fill::kSurface) {
      all.emplace_back("disc", FieldGeometry(Disc{{}, {1, 2, 3}, 9, 4}, look));
      all.emplace_back("patch", FieldGeometry(Patch{{-6, -5, 3}, {12, 2, -6}, {-2, 10, 5}}, look));
      all.emplace_back("polygon", FieldGeometry(Polygon{corners, ends}, look));
    }
    Graph graph;
    const auto parsed = implicit::ParseShape(
        "sin(x)*cos(0.7*y) + sin(0.8*z) = 0.2 where length(x, y, z) <= 9", {}, {}, graph);
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    FieldShape shape;
    shape.surface = parsed->surface;
    shape.bound = parsed->bound;
    all.emplace_back("expression", FieldGeometry(graph, shape, look));
  }
}

void AddPointsAndLines(std::vector<Named>& all) {
  for (const Splat splat : {Splat::kBall, Splat::kSoft, Splat::kCube, Splat::kCell}) {
    ModelGeometry g;
    g.record.kind = PrimitiveKind::kPoints;
    g.record.splat = splat;
    g.record.thickness = splat == Splat::kCell ? 0.0F : 5.3F;
    AddPoints(g, Places(40));
    all.emplace_back("points", g);
  }
  for (const PrimitiveKind kind : {PrimitiveKind::kSegments, PrimitiveKind::kCurves}) {
    for (const float thickness : {0.0F, 3.7F}) {
      for (const LineSampling sampling :
           {LineSampling::kThin, LineSampling::kEuclidean, LineSampling::kCover}) {
        ModelGeometry g;
        g.record.kind = kind;
        g.record.sampling = sampling;
        g.record.thickness = thickness;
        g.record.topology = Topology::kStrip;
        AddPoints(g, Places(10));
        all.emplace_back(kind == PrimitiveKind::kCurves ? "curves" : "segments", g);
      }
    }
  }
}

void AddSurfaces(std::vector<Named>& all) {
  for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
    ModelGeometry patches, mesh, map, filled;
    patches.record.kind = PrimitiveKind::kPatches;
    AddPoints(patches, Places(16));
    mesh.record.kind = PrimitiveKind::kTriangles;
    AddPoints(mesh, Places(12));
    // Arranged like a height map: a grid of samples, with two triangles for each square.
    map.record.kind = PrimitiveKind::kTriangles;
    std::vector<Vector> samples;
    for (int i = 0; i < 25; ++i)
      samples.push_back({i % 5 * 4.0 - 8, i / 5 * 4.0 - 8, 5 * std::sin(i * 1.3)});
    AddPoints(map, samples);
    for (uint32_t i = 0; i < 19; ++i) {
      if (i % 5 < 4) map.indices.insert(map.indices.end(), {i, i + 1, i + 6, i, i + 6, i + 5});
    }
    map.record.index_count = static_cast<uint32_t>(map.indices.size());
    filled.record.kind = PrimitiveKind::kFilled;
    AddPoints(filled, Places(4), false);
    filled.indices = {0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0};
    filled.record.index_count = 12;
    // A picture of 4 × 4 texels on a triangle mesh of one colour.
    ModelGeometry textured;
    textured.record.kind = PrimitiveKind::kTriangles;
    AddPoints(textured, Places(9), false);
    textured.record.texture_width = textured.record.texture_height = 4;
    for (uint32_t i = 0; i < 18; ++i)
      textured.colors.push_back(std::bit_cast<uint32_t>(static_cast<float>(i * i % 7) / 5));
    while (textured.colors.size() < ColorCount(textured.record))
      textured.colors.push_back(0x10305 * static_cast<uint32_t>(textured.colors.size()) & 0xFFFFFF);
    for (auto& [name, g] : std::vector<Named>{{"patches", patches},
                                              {"mesh", mesh},
                                              {"height map", map},
                                              {"filled mesh", filled},
                                              {"textured mesh", textured}}) {
      g.record.rule = rule;
      all.emplace_back(name, g);
      if (g.record.kind == PrimitiveKind::kFilled) continue;
      g.record.thickness = 3.3F;
      all.emplace_back("thick " + name, g);
    }
  }
}

void AddGrids(std::vector<Named>& all) {
  const auto waves = [](double x, double y, double z) {
    return 128 + 127 * std::sin(x) * std::cos(0.8 * y) * std::sin(0.6 * z + 1);
  };
  for (const SampleFilter filter : {SampleFilter::kLinear, SampleFilter::kNearest}) {
    all.emplace_back("volume", GridGeometry(11, filter, waves, false, 0));
    all.emplace_back("isosurface", GridGeometry(11, filter, waves, true, 140, {.thickness = 1.5F}));
    // Coloured by the place along a direction.
    ModelGeometry colored = GridGeometry(11, filter, waves, true, 140);
    colored.indices[offsetof(SampleHead, by_level) / sizeof(uint32_t)] = 2;
    const float by_place[] = {11.5F, -7.25F, 9, 100};
    std::copy(std::begin(by_place), std::end(by_place), colored.record.params);
    all.emplace_back("coloured isosurface", colored);
    all.emplace_back("solid isosurface",
                     GridGeometry(11, filter, waves, true, 140, {.fill = Fill::kSolid}));
  }
}

class Shifts : public PlacedShapes {
 protected:
  Shifts() : PlacedShapes(kSize) {}
};

INSTANTIATE_TEST_SUITE_P(Engines, Shifts, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Shifts, ByWholeVoxelsShiftEverything) {
  std::vector<Named> all;
  AddOwn(all);
  AddFields(all);
  AddPointsAndLines(all);
  AddSurfaces(all);
  AddGrids(all);
  for (const auto& [name, geometry] : all) {
    SCOPED_TRACE(name + ", kind " + std::to_string(static_cast<uint32_t>(geometry.record.kind)));
    // Its middle (for a grid, that of its samples) is placed where there is neither a corner nor a
    // centre of a voxel.
    Placement placed = Placed(0.9, 1.07, 0, 0);
    const double half = geometry.record.kind == PrimitiveKind::kSamples ? 5.5 : 0;
    const Vector corner = placed.Forth({-half, -half, -half});
    const double middle[3] = {20.13, 38.71, 18.32};
    for (int a = 0; a < 3; ++a) placed.map.m[a * 4 + 3] = corner[a] + middle[a];
    const Drawn before = Draw(geometry, placed.map);
    for (int a = 0; a < 3; ++a) placed.map.m[a * 4 + 3] += kBy[a];
    const Drawn after = Draw(geometry, placed.map);
    uint64_t wrong = 0, lit = 0;
    before.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const int32_t to[3] = {x + kBy[0], y + kBy[1], z + kBy[2]};
      if (!before.Holds(to[0], to[1], to[2])) {
        wrong += before.Lit(x, y, z);  // nothing is lost
        return;
      }
      lit += before.Lit(x, y, z);
      wrong += before.At(x, y, z) != after.At(to[0], to[1], to[2]);
    });
    EXPECT_EQ(wrong, 0u);
    EXPECT_EQ(lit, CountLit(after.rgb));
    EXPECT_GT(lit, 30u);
  }
}

}  // namespace shifts_test
}  // namespace voxeld::gpu::conformance
