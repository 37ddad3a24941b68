// Compares solids with their shapes in closed form. The definition states the order of the
// single-precision operations; this test judges whether they describe the shape: centre and half
// axes are mapped in extended precision, and a voxel's centre is located by volumes of
// parallelepipeds, without an inverse map. Centres within kMargin of the surface are left to the
// definition, and counted.
#include <array>
#include <cmath>
#include <optional>

#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace solids_test {

constexpr int32_t kSize = 32;
constexpr double kPi = 3.14159265358979323846;
constexpr long double kMargin = 2e-5L;  // relative to the shape's own half axes

using Vec = std::array<long double, 3>;

// Returns the signed volume of the parallelepiped with these edges.
long double Volume(const Vec& a, const Vec& b, const Vec& c) {
  return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
         a[2] * (b[0] * c[1] - b[1] * c[0]);
}

enum class Side { kInside, kOutside, kNearSurface };

class ClosedForm {
 public:
  ClosedForm(const GeometryRecord& g, const Affine& map) : kind_(g.kind) {
    long double half[3] = {g.params[3], g.params[3], g.params[3]};
    if (kind_ == PrimitiveKind::kBox) {
      for (int a = 0; a < 3; ++a) half[a] = g.params[3 + a] / 2.0L;
    } else if (kind_ == PrimitiveKind::kCylinder) {
      half[2] = g.params[4] / 2.0L;
    }
    for (int row = 0; row < 3; ++row) {
      long double centre = map.m[row * 4 + 3];
      for (int axis = 0; axis < 3; ++axis) {
        centre += static_cast<long double>(map.m[row * 4 + axis]) * g.params[axis];
        axes_[axis][row] = map.m[row * 4 + axis] * half[axis];
      }
      const long double units = centre * 256 + 0.5L;
      centre_[row] = std::floor(units) / 256;
      const long double over = units - std::floor(units);
      exact_ = exact_ && over > 1e-6L && over < 1 - 1e-6L;
    }
    volume_ = Volume(axes_[0], axes_[1], axes_[2]);
  }

  // Returns false if the centre is too near to half-way between two units to be sure of its own
  // unit, or if the shape is so thin somewhere that it is drawn thicker.
  bool plain() const {
    if (!exact_ || std::abs(volume_) < 0.05L) return false;
    for (int axis = 0; axis < 3; ++axis) {
      for (int a = 0; a < 3; ++a) {
        Vec unit = {};
        unit[a] = 1;
        if (std::abs(Along(axis, unit)) > 1.9L) return false;
      }
    }
    return true;
  }

  double volume() const {
    const double factor = kind_ == PrimitiveKind::kBox      ? 8
                          : kind_ == PrimitiveKind::kSphere ? 4 * kPi / 3
                                                            : 2 * kPi;
    return factor * static_cast<double>(std::abs(volume_));
  }

  Side SideOf(int32_t x, int32_t y, int32_t z) const {
    const Vec d = {x + 0.5L - centre_[0], y + 0.5L - centre_[1], z + 0.5L - centre_[2]};
    const long double u = Along(0, d), v = Along(1, d), w = Along(2, d);
    long double reach = 0;  // 1 on the surface
    if (kind_ == PrimitiveKind::kBox) {
      reach = std::max({std::abs(u), std::abs(v), std::abs(w)});
    } else if (kind_ == PrimitiveKind::kSphere) {
      reach = std::sqrt(u * u + v * v + w * w);
    } else {
      reach = std::max(std::hypot(u, v), std::abs(w));
    }
    if (std::abs(reach - 1) < kMargin) return Side::kNearSurface;
    return reach < 1 ? Side::kInside : Side::kOutside;
  }

  // Returns whether (x, y, z) is the voxel of the centre.
  bool Centre(int32_t x, int32_t y, int32_t z) const {
    return std::floor(centre_[0]) == x && std::floor(centre_[1]) == y &&
           std::floor(centre_[2]) == z;
  }

 private:
  // Returns `d` along a half axis, whose end is at 1.
  long double Along(int axis, const Vec& d) const {
    std::array<Vec, 3> edges = axes_;
    edges[static_cast<size_t>(axis)] = d;
    return Volume(edges[0], edges[1], edges[2]) / volume_;
  }

  PrimitiveKind kind_;
  std::array<Vec, 3> axes_;
  Vec centre_;
  long double volume_ = 0;
  bool exact_ = true;
};

// Returns whether the voxel is drawn; nullopt if a centre near the surface decides.
std::optional<bool> Drawn(const ClosedForm& shape, const GeometryRecord& g, int32_t x, int32_t y,
                          int32_t z) {
  const Side side = shape.SideOf(x, y, z);
  if (side == Side::kNearSurface) return std::nullopt;
  // A shape that misses the voxel of its own centre covers it all the same.
  if (side == Side::kOutside && shape.Centre(x, y, z)) return true;
  if (side == Side::kOutside || g.fill == Fill::kSolid) return side == Side::kInside;
  bool near = false;
  for (int32_t dz = -1; dz <= 1; ++dz) {
    for (int32_t dy = -1; dy <= 1; ++dy) {
      for (int32_t dx = -1; dx <= 1; ++dx) {
        if (g.rule == SurfaceRule::kThin && dx * dx + dy * dy + dz * dz != 1) continue;
        const Side beside = shape.SideOf(x + dx, y + dy, z + dz);
        if (beside == Side::kOutside) return true;
        near = near || beside == Side::kNearSurface;
      }
    }
  }
  return near ? std::nullopt : std::optional(false);
}

class Solids : public EngineConformance {
 protected:
  Solids() : engine_(Make({.threads = 1, .inline_execution = true})) {
    EXPECT_TRUE(engine_.SetTarget(CubeTarget(kSize)).ok());
  }
  std::vector<uint32_t> Draw(const GeometryRecord& g, const Affine& map) {
    SceneModel scene;
    scene.layers[1].id = 1;
    scene.geometries[1].record = g;
    scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1};
    scene.drawables[1].transform = map;
    DeltaBuffer delta;
    delta.PutWhole(scene);
    EXPECT_TRUE(engine_.Apply(delta).ok());
    EXPECT_EQ(engine_.Frame().status(), absl::OkStatus());
    return engine_.Voxels();
  }
  EngineDriver engine_;
};

TEST_P(Solids, AreTheVoxelsWhoseCentresTheShapeHolds) {
  const uint64_t seed = SeedOr(5000);
  uint64_t judged = 0, near = 0, lit = 0;
  for (uint64_t i = 0, shapes = 0; shapes < 150; ++i) {
    ASSERT_LT(i, 1000u) << "too few shapes can be judged";
    SCOPED_TRACE("VOXELD_SEED=" + std::to_string(seed + i));
    SceneGenerator generator(seed + i);
    GeometryRecord g;
    g.id = 1;
    g.kind = static_cast<PrimitiveKind>(4 + i % 3);
    g.fill = static_cast<Fill>(generator.Int(0, 1));
    g.rule = static_cast<SurfaceRule>(generator.Int(0, 1));
    for (int p = 0; p < 3; ++p) g.params[p] = static_cast<float>(generator.Real(-2, 2));
    for (int p = 3; p < 6; ++p) g.params[p] = static_cast<float>(generator.Real(1, 12));
    Affine map;
    for (int m = 0; m < 12; ++m) {
      map.m[m] = m % 4 == 3 ? generator.Real(8, 24) : generator.Real(-1.2, 1.2);
    }
    const ClosedForm shape(g, map);
    if (!shape.plain()) continue;
    ++shapes;
    const std::vector<uint32_t> voxels = Draw(g, map);
    size_t at = 0;
    for (int32_t z = 0; z < kSize; ++z) {
      for (int32_t y = 0; y < kSize; ++y) {
        for (int32_t x = 0; x < kSize; ++x) {
          const bool drawn = voxels[at++] != 0;
          const std::optional<bool> want = Drawn(shape, g, x, y, z);
          ++judged;
          near += !want;
          lit += drawn;
          if (!want) continue;
          ASSERT_EQ(drawn, *want) << "kind " << static_cast<int>(g.kind) << ", voxel (" << x << ", "
                                  << y << ", " << z << ")";
        }
      }
    }
  }
  std::cout << near << " of " << judged << " voxels near a surface, " << lit << " lit\n";
  EXPECT_GT(lit, 50'000u);
  EXPECT_LT(near, judged / 1000);
}

TEST_P(Solids, HaveTheVolumesOfTheirShapes) {
  for (int kind = 4; kind <= 6; ++kind) {
    GeometryRecord g;
    g.id = 1;
    g.kind = static_cast<PrimitiveKind>(kind);
    g.fill = Fill::kSolid;
    const float sizes[] = {0.01F, 0.02F, -0.03F, 9, 11, 13};
    std::copy(std::begin(sizes), std::end(sizes), g.params);
    Affine map;  // sheared, stretched, within the grid
    const double leaning[] = {1, 0.2, 0, 16.1, -0.2, 0.9, 0.1, 15.9, 0.05, -0.1, 1.1, 16.2};
    std::copy(std::begin(leaning), std::end(leaning), map.m);
    const double lit = static_cast<double>(CountLit(Draw(g, map)));
    const double volume = ClosedForm(g, map).volume();
    EXPECT_NEAR(lit / volume, 1, 0.02) << "kind " << kind << ": " << lit << " of " << volume;
  }
}

INSTANTIATE_TEST_SUITE_P(Engines, Solids, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

}  // namespace solids_test
}  // namespace voxeld::gpu::conformance
