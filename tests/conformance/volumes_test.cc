// Every solid of about 20 voxels in radius has its volume within 1 %, at any place and in any
// orientation; on every engine. Isosurfaces are also where the samples have the level, and no path
// leads through them.
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gpu/implicit/parse.h"
#include "gpu/primitives/arrow.h"
#include "gpu/primitives/cone.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/parallelepiped.h"
#include "gpu/primitives/prism.h"
#include "gpu/primitives/torus.h"
#include "tests/conformance/placed.h"

namespace voxeld::gpu::conformance {
namespace volumes_test {

constexpr int32_t kSize = 80;
constexpr double kPi = std::numbers::pi;

struct Solid {
  std::string name;
  ModelGeometry geometry;
  double volume;
};

// The volume of two spheres, neither within the other, and the space between them: a cone's frustum
// from circle to circle, where the cone touches them, and the cap of each sphere beyond its circle.
double CapsuleVolume(double ra, double rb, double length) {
  const double sine = (ra - rb) / length, square = 1 - sine * sine;
  const auto cap = [](double r, double height) {
    return kPi * height * height * (3 * r - height) / 3;
  };
  const double frustum = kPi * length * square * square / 3 * (ra * ra + ra * rb + rb * rb);
  return frustum + cap(ra, ra + ra * sine) + cap(rb, rb - rb * sine);
}

ModelGeometry Own(PrimitiveKind kind, float a, float b, float c) {
  ModelGeometry g;
  g.record.kind = kind;
  g.record.fill = Fill::kSolid;
  g.record.params[3] = a;
  g.record.params[4] = b;
  g.record.params[5] = c;
  return g;
}

ModelGeometry Text(const std::string& text) {
  Graph graph;
  const auto parsed = implicit::ParseShape(text, {}, {}, graph);
  EXPECT_TRUE(parsed.ok()) << parsed.status();
  FieldShape shape;
  shape.surface = parsed->surface;
  shape.bound = parsed->bound;
  return FieldGeometry(graph, shape, {.fill = Fill::kSolid});
}

// A ring of square section: an outer and an inner wall, a floor and a lid.
ModelGeometry MeshRing(double outer, double inner, double half) {
  ModelGeometry mesh;
  mesh.record.kind = PrimitiveKind::kFilled;
  constexpr uint32_t kAround = 240;
  for (uint32_t i = 0; i < kAround; ++i) {
    const double turn = 2 * kPi * i / kAround;
    for (const auto& [r, z] :
         {std::pair(outer, -half), {outer, half}, {inner, half}, {inner, -half}}) {
      for (const double c : {r * std::cos(turn), r * std::sin(turn), z})
        mesh.positions.push_back(static_cast<float>(c));
    }
    const uint32_t next = (i + 1) % kAround;
    for (uint32_t k = 0; k < 4; ++k) {
      const uint32_t a = 4 * i + k, b = 4 * i + (k + 1) % 4, c = 4 * next + (k + 1) % 4,
                     d = 4 * next + k;
      mesh.indices.insert(mesh.indices.end(), {a, b, c, a, c, d});
    }
  }
  mesh.record.vertex_count = 4 * kAround;
  mesh.record.index_count = static_cast<uint32_t>(mesh.indices.size());
  return mesh;
}

std::vector<Solid> AllSolids() {
  const GeometryRecord solid{.fill = Fill::kSolid};
  std::vector<Solid> all;
  all.push_back({"sphere", Own(PrimitiveKind::kSphere, 20, 0, 0), 4 * kPi / 3 * 8000});
  all.push_back({"box", Own(PrimitiveKind::kBox, 40, 36, 30), 40 * 36 * 30});
  all.push_back({"cylinder", Own(PrimitiveKind::kCylinder, 20, 34, 0), kPi * 400 * 34});
  all.push_back(
      {"ellipsoid", FieldGeometry(Ellipsoid{{}, {24, 20, 16}}, solid), 4 * kPi / 3 * 24 * 20 * 16});
  all.push_back({"torus", FieldGeometry(Torus{{}, 20, 9}, solid), 2 * kPi * kPi * 20 * 81});
  for (const double end : {0.0, 12.0, 20.0}) {
    all.push_back({"cone to " + std::to_string(end),
                   FieldGeometry(Cone{{-4, -8, -16}, {4, 8, 16}, 20, end, false}, solid),
                   kPi * std::sqrt(1344.0) / 3 * (400 + 20 * end + end * end)});
  }
  for (const double end : {8.0, 20.0}) {
    all.push_back({"capsule to " + std::to_string(end),
                   FieldGeometry(Cone{{-4, -6, -8}, {4, 6, 8}, 20, end, true}, solid),
                   CapsuleVolume(20, end, std::sqrt(464.0))});
  }
  const Parallelepiped leaning{{}, {{36, 4, 0}, {-8, 34, 6}, {4, -6, 38}}};
  all.push_back({"parallelepiped", FieldGeometry(leaning, solid), 49'120});
  // The shaft reaches into the head, which is wider there.
  all.push_back({"arrow", FieldGeometry(Arrow{{0, 0, -27}, {0, 0, 27}, 9, 24, 20}, solid),
                 kPi * 81 * 30 + kPi * 400 * 24 / 3});
  // A square with a hole: 40² − 16².
  const std::vector<Vector> corners = {{-20, -20, 0}, {20, -20, 0}, {20, 20, 0}, {-20, 20, 0},
                                       {-8, -8, 0},   {8, -8, 0},   {8, 8, 0},   {-8, 8, 0}};
  const std::vector<uint32_t> ends = {4, 8};
  all.push_back({"prism", FieldGeometry(Prism{corners, ends, 20}, solid), (1600 - 256) * 20});
  // The rest of a ball with a hole of radius 10 drilled through it.
  all.push_back({"expression", Text("x^2+y^2+z^2 <= 400 and x^2+y^2 >= 100"),
                 4 * kPi / 3 * std::pow(300, 1.5)});
  all.push_back({"filled mesh", MeshRing(22, 10, 11), kPi * (22 * 22 - 100) * 22});
  return all;
}

class Volumes : public PlacedShapes {
 protected:
  Volumes() : PlacedShapes(kSize) {}
  void ExpectVolume(const Solid& solid, const Placement& placed, double off) {
    const double lit = static_cast<double>(CountLit(Draw(solid.geometry, placed.map).rgb));
    EXPECT_NEAR(lit / solid.volume, 1, 0.01) << solid.name << ", " << off << " off: " << lit;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, Volumes, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Volumes, AreThoseOfTheShapes) {
  for (const Solid& solid : AllSolids()) {
    for (const double off : {0.13, 0.41, 0.77}) {
      ExpectVolume(solid, Placed(0.4 + 3 * off, 1, kSize / 2, off), off);
    }
  }
}

// Returns samples, a voxel apart, of the depth in a ball.
ModelGeometry BallBySamples(SampleFilter filter, const GeometryRecord& look) {
  constexpr uint32_t kSamples = 48;
  return GridGeometry(
      kSamples, filter,
      [](double x, double y, double z) {
        return 20 - std::sqrt((x - 24) * (x - 24) + (y - 24) * (y - 24) + (z - 24) * (z - 24));
      },
      true, 0, look);
}
// The middle of the samples is at that of the volume, or `off` away from it.
Placement BallPlaced(double off) {
  Placement placed = Placed(0.4 + 3 * off, 1, kSize / 2, off);
  const Vector corner = placed.Forth({-24, -24, -24});
  for (int a = 0; a < 3; ++a) placed.map.m[a * 4 + 3] = corner[a];
  return placed;
}

TEST_P(Volumes, OfIsosurfacesToo) {
  const Solid ball{"isosurface", BallBySamples(SampleFilter::kLinear, {.fill = Fill::kSolid}),
                   4 * kPi / 3 * 8000};
  for (const double off : {0.13, 0.41, 0.77}) ExpectVolume(ball, BallPlaced(off), off);
}

TEST_P(Volumes, IsosurfacesAreWhereTheLevelIsAndNothingGetsThrough) {
  const Placement placed = BallPlaced(0.41);
  // Values interpolated between samples of a distance are off by at most an eighth of its second
  // derivatives, two of 1 / 20, and their slope by half of them; values of NEAREST are off by half
  // a sample's diagonal.
  for (const auto& [filter, error] :
       {std::pair(SampleFilter::kLinear, 0.0125), {SampleFilter::kNearest, kHalfDiagonal}}) {
    for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      for (const float thickness : {0.0F, 0.5F, 2.5F}) {
        if (filter == SampleFilter::kNearest && thickness > 0) continue;  // has no slope
        SCOPED_TRACE(absl::StrCat("filter ", filter == SampleFilter::kNearest, ", rule ",
                                  rule == SurfaceRule::kCover, ", thickness ", thickness));
        const Drawn drawn =
            Draw(BallBySamples(filter, {.rule = rule, .thickness = thickness}), placed.map);
        const std::vector<uint8_t> outside =
            drawn.Reached({0, 0, 0}, false, rule == SurfaceRule::kCover);
        // The nearer one of two neighbours on either side is lit.
        const double apart = rule == SurfaceRule::kCover ? std::sqrt(3.0) : 1;
        const double most = std::max(thickness / 2.0, apart / 2) + 2 * error;
        uint64_t lit = 0, inside = 0;
        drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
          const Vector v = placed.Back(x, y, z) - Vector{24, 24, 24};
          const double depth = 20 - implicit::Length(v);
          const bool here = drawn.Lit(x, y, z);
          lit += here;
          if (here && filter == SampleFilter::kLinear) {
            ASSERT_LE(std::fabs(depth), most);
          } else if (here) {
            ASSERT_LE(std::fabs(depth), apart + error);
          } else {
            ASSERT_GE(std::fabs(depth), 0.97 * thickness / 2.0 - 2 * error);
          }
          if (depth < 2) return;
          ++inside;
          ASSERT_EQ(outside[drawn.Index(x, y, z)], 0) << x << ", " << y << ", " << z;
        });
        EXPECT_GT(lit, 4000u);
        EXPECT_GT(inside, 20'000u);
      }
    }
  }
}

}  // namespace volumes_test
}  // namespace voxeld::gpu::conformance
