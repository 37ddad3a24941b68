// Compares boxes, spheres and cylinders, which have coverage code of their own, with the same
// shapes drawn by the general method and by their expressions, on every engine: the same solids,
// except where a centre lies on the surface, and surfaces that are nowhere more than a voxel apart.
// Distances far from the surface are computed in double precision.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "gpu/implicit/parse.h"
#include "gpu/primitives/cone.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/parallelepiped.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace own_forms_test {

using implicit::FieldShape;
using implicit::Graph;
using implicit::Vector;

constexpr int32_t kSize = 44;
constexpr double kMargin = 1e-2;  // voxels: origins are snapped to 2⁻⁸ voxel

struct Form {
  std::string name;
  PrimitiveKind kind;
  std::array<float, 3> measures;  // params[3] and the following
  std::function<FieldShape(Graph&)> make;
  std::string text;
  std::function<double(const Vector&)> distance;  // signed; beyond edges, the distance from the
                                                  // planes
};

std::vector<Form> Forms() {
  return {
      {"box",
       PrimitiveKind::kBox,
       {22, 15, 9},
       [](Graph& g) {
         return Parallelepiped{{}, {{22, 0, 0}, {0, 15, 0}, {0, 0, 9}}}.Make(g);
       },
       "max(abs(x) - 11, max(abs(y) - 7.5, abs(z) - 4.5)) = 0",
       [](const Vector& p) {
         return std::max({std::fabs(p.x) - 11, std::fabs(p.y) - 7.5, std::fabs(p.z) - 4.5});
       }},
      {"sphere",
       PrimitiveKind::kSphere,
       {13.3f, 0, 0},
       [](Graph& g) {
         return Ellipsoid{{}, {13.3, 13.3, 13.3}}.Make(g);
       },
       "x^2 + y^2 + z^2 = 13.3^2",
       [](const Vector& p) { return implicit::Length(p) - 13.3; }},
      {"cylinder",
       PrimitiveKind::kCylinder,
       {8.2f, 21, 0},
       [](Graph& g) {
         return Cone{{0, 0, -10.5}, {0, 0, 10.5}, 8.2, 8.2, false}.Make(g);
       },
       "max(length(x, y) - 8.2, abs(z) - 10.5) = 0",
       [](const Vector& p) { return std::max(std::hypot(p.x, p.y) - 8.2, std::fabs(p.z) - 10.5); }},
  };
}

class OwnForms : public EngineConformance {
 protected:
  OwnForms() : engine_(Make({.threads = 1, .inline_execution = true})) {
    EXPECT_TRUE(engine_.SetTarget(CubeTarget(kSize)).ok());
  }

  std::vector<uint32_t> Draw(ModelGeometry g, const Affine& map) {
    g.record.id = 1;
    SceneModel scene;
    scene.layers[1].id = 1;
    scene.geometries[1] = std::move(g);
    scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1};
    scene.drawables[1].transform = map;
    DeltaBuffer delta;
    delta.Reset();
    delta.PutWhole(scene);
    EXPECT_TRUE(engine_.Apply(delta).ok());
    EXPECT_EQ(engine_.Frame().status(), absl::OkStatus());
    return engine_.Voxels();
  }
  std::vector<uint32_t> DrawOwn(const Form& form, const GeometryRecord& look, const Affine& map) {
    ModelGeometry g{.record = look, .positions = {}, .indices = {}, .colors = {}};
    g.record.kind = form.kind;
    std::copy(form.measures.begin(), form.measures.end(), g.record.params + 3);
    return Draw(std::move(g), map);
  }
  std::vector<uint32_t> DrawText(const Form& form, const GeometryRecord& look, const Affine& map) {
    Graph graph;
    const auto parsed = implicit::ParseShape(form.text, {}, {}, graph);
    EXPECT_TRUE(parsed.ok()) << parsed.status();
    FieldShape shape;
    shape.surface = parsed->surface;
    shape.bound = parsed->bound;
    return DrawField(graph, shape, look, map);
  }
  std::vector<uint32_t> DrawGeneral(const Form& form, const GeometryRecord& look,
                                    const Affine& map) {
    Graph graph;
    return DrawField(graph, form.make(graph), look, map);
  }
  std::vector<uint32_t> DrawField(Graph& graph, const FieldShape& shape, const GeometryRecord& look,
                                  const Affine& map) {
    ModelGeometry g{.record = look, .positions = {}, .indices = {}, .colors = {}};
    g.record.kind = PrimitiveKind::kImplicit;
    g.indices = *implicit::Compile(graph, {.surface = shape.surface, .bound = shape.bound});
    g.record.index_count = static_cast<uint32_t>(g.indices.size());
    return Draw(std::move(g), map);
  }

  EngineDriver engine_;
};

// A rotation about z, then x, and a place off the grid, so that few centres lie on a surface.
Affine Turned(double a, double b) {
  Affine map;
  const double ca = std::cos(a), sa = std::sin(a), cb = std::cos(b), sb = std::sin(b);
  const double rows[3][3] = {{ca, -sa, 0}, {cb * sa, cb * ca, -sb}, {sb * sa, sb * ca, cb}};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) map.m[r * 4 + c] = rows[r][c];
    map.m[r * 4 + 3] = kSize / 2 + 0.3 * (r + 1);
  }
  return map;
}

Vector Back(const Affine& map, int32_t x, int32_t y, int32_t z) {
  const double d[3] = {x + 0.5 - map.m[3], y + 0.5 - map.m[7], z + 0.5 - map.m[11]};
  double q[3];
  for (int c = 0; c < 3; ++c) q[c] = map.m[c] * d[0] + map.m[4 + c] * d[1] + map.m[8 + c] * d[2];
  return {q[0], q[1], q[2]};
}

size_t At(int32_t x, int32_t y, int32_t z) {
  return (static_cast<size_t>(z) * kSize + static_cast<size_t>(y)) * kSize + static_cast<size_t>(x);
}

template <typename Each>
void ForEachVoxel(Each&& each) {
  for (int32_t z = 1; z + 1 < kSize; ++z) {
    for (int32_t y = 1; y + 1 < kSize; ++y) {
      for (int32_t x = 1; x + 1 < kSize; ++x) each(x, y, z);
    }
  }
}

TEST_P(OwnForms, SolidsAreTheSame) {
  uint64_t inside = 0;
  for (const Form& form : Forms()) {
    for (const double angle : {0.0, 0.7}) {
      SCOPED_TRACE(form.name);
      const Affine map = Turned(angle, angle * 1.3);
      GeometryRecord look;
      look.fill = Fill::kSolid;
      const std::vector<uint32_t> own = DrawOwn(form, look, map);
      const std::vector<uint32_t> general = DrawGeneral(form, look, map);
      const std::vector<uint32_t> text = DrawText(form, look, map);
      ForEachVoxel([&](int32_t x, int32_t y, int32_t z) {
        const double d = form.distance(Back(map, x, y, z));
        if (std::fabs(d) < kMargin) return;
        EXPECT_EQ(own[At(x, y, z)] != 0, d < 0) << d;
        EXPECT_EQ(general[At(x, y, z)] != 0, d < 0) << d;
        EXPECT_EQ(text[At(x, y, z)] != 0, d < 0) << d;
        inside += d < 0;
      });
    }
  }
  EXPECT_GT(inside, 30'000u);
}

TEST_P(OwnForms, SurfacesAreWithinAVoxelOfOneAnother) {
  uint64_t lit = 0;
  for (const Form& form : Forms()) {
    for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      SCOPED_TRACE(form.name);
      const Affine map = Turned(0.6, 0.9);
      GeometryRecord look;
      look.rule = rule;
      const std::vector<uint32_t> surfaces[3] = {
          DrawOwn(form, look, map), DrawGeneral(form, look, map), DrawText(form, look, map)};
      // A neighbour on the other side is at most as far away.
      const double most = (rule == SurfaceRule::kThin ? 1 : std::sqrt(3.0)) + kMargin;
      for (int which = 0; which < 3; ++which) {
        ForEachVoxel([&](int32_t x, int32_t y, int32_t z) {
          if (surfaces[which][At(x, y, z)] == 0) return;
          ++lit;
          EXPECT_LE(std::fabs(form.distance(Back(map, x, y, z))), most) << which;
          for (const std::vector<uint32_t>& other : surfaces) {
            bool near = false;
            for (int n = 0; n < 27; ++n) {
              near |= other[At(x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1)] != 0;
            }
            EXPECT_TRUE(near) << which << ": (" << x << ", " << y << ", " << z << ") is alone";
          }
        });
      }
    }
  }
  EXPECT_GT(lit, 10'000u);
}

INSTANTIATE_TEST_SUITE_P(Engines, OwnForms, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

}  // namespace own_forms_test
}  // namespace voxeld::gpu::conformance
