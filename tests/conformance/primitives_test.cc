// Compares each primitive's scalar definition with the oracle's, item by item and box by box, in
// hard cases: far away, on faces and centres, along axes, with ties, in both directions.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <map>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "gpu/primitives/list.h"
#include "tests/conformance/oracle_shapes.h"
#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu::conformance {
namespace {

using Voxels = std::map<std::tuple<int64_t, int64_t, int64_t>, std::map<uint32_t, bool>>;

constexpr int32_t kSize = 20;

DenseVolume Grid() {
  DenseVolume grid;
  grid.nx = grid.ny = grid.nz = kSize;
  return grid;
}

// Collects voxels from an engine's primitive, in boxes of `step` voxels that together make up the
// grid.
template <class Draw>
Voxels InBoxes(int32_t step, const Draw& draw) {
  Voxels voxels;
  for (int32_t z = 0; z < kSize; z += step) {
    for (int32_t y = 0; y < kSize; y += step) {
      for (int32_t x = 0; x < kSize; x += step) {
        const Box3 box{
            {x, y, z},
            {std::min(x + step, kSize), std::min(y + step, kSize), std::min(z + step, kSize)}};
        draw(box, [&](int32_t vx, int32_t vy, int32_t vz, uint32_t rgb) {
          EXPECT_TRUE(Contains(box, vx, vy, vz)) << vx << " " << vy << " " << vz;
          voxels[{vx, vy, vz}][rgb] = true;
        });
      }
    }
  }
  return voxels;
}

template <class PlotAll>
Voxels FromOracle(const PlotAll& plot_all) {
  Voxels voxels;
  plot_all([&](int64_t x, int64_t y, int64_t z, uint32_t rgb) { voxels[{x, y, z}][rgb] = true; });
  return voxels;
}

// Coordinates that reveal errors: on and just beside faces and centres, inside, around and far
// away.
class HardCoordinates {
 public:
  explicit HardCoordinates(SceneGenerator& generator) : generator_(generator) {}

  // `far`: the greatest distance is 2^far units.
  Units Next(int far) {
    Units u;
    for (int64_t& c : u.v) {
      switch (generator_.Int(0, 9)) {
        case 0:
          c = generator_.Int(-2, kSize + 2) * 256;
          break;
        case 1:
          c = generator_.Int(-2, kSize + 2) * 256 + 128;
          break;
        case 2:
          c = generator_.Int(-2, kSize + 2) * 256 + generator_.Int(-1, 1);
          break;
        case 3:
          if (used_) {
            c = last_.v[&c - u.v];  // parallel to an axis
            break;
          }
          [[fallthrough]];
        case 4: {
          const int64_t reach = int64_t{1} << generator_.Int(8, far);
          c = generator_.Int(-reach, reach);
          break;
        }
        default:
          c = generator_.Int(-3 * 256, (kSize + 3) * 256);
      }
    }
    // Proportional differences give ties at edges and corners.
    if (used_ && generator_.Chance(0.15)) {
      const int64_t d = generator_.Int(-kSize, kSize) * 256;
      for (int a = 0; a < 3; ++a) u.v[a] = last_.v[a] + d * generator_.Int(-1, 1);
    }
    for (int64_t& c : u.v) c = std::clamp(c, -kMaxUnits, kMaxUnits);
    last_ = u;
    used_ = true;
    return u;
  }

 private:
  SceneGenerator& generator_;
  Units last_{};
  bool used_ = false;
};

Int3 ToInt3(const Units& u) {
  Int3 r;
  for (int a = 0; a < 3; ++a) r[a] = u.v[a];
  return r;
}

std::string Text(const Units& u) {
  return absl::StrCat("(", u.v[0], ", ", u.v[1], ", ", u.v[2], ")");
}

const int32_t kSteps[] = {kSize, 16, 7};

TEST(Primitives, LinesEqualTheOracleInEveryBox) {
  const uint64_t seed = SeedOr(10);
  std::cout << "VOXELD_SEED=" << seed << "\n";
  SceneGenerator generator(seed);
  HardCoordinates hard(generator);
  const DenseVolume grid = Grid();
  size_t hits = 0;
  for (int i = 0; i < 6000; ++i) {
    const int far = i % 3 == 0 ? 38 : i % 3 == 1 ? 16 : 13;
    OracleLine line{hard.Next(far), hard.Next(far), 0x102030, 0xFFEE01,
                    static_cast<LineSampling>(i % 3)};
    if (generator.Chance(0.3)) line.color_e = line.color_s;
    SCOPED_TRACE(absl::StrCat(Text(line.s), " to ", Text(line.e), ", sampling ", i % 3));
    const Voxels want = FromOracle([&](const Plot& plot) { PlotLine(line, grid, plot); });
    const Line ours{ToInt3(line.s), ToInt3(line.e), line.color_s, line.color_e, line.sampling};
    hits += want.size();
    ASSERT_TRUE(InBoxes(kSteps[generator.Int(0, 2)], [&](const Box3& box, const auto& emit) {
                  EmitLine(ours, box, emit);
                }) == want);
  }
  EXPECT_GT(hits, 6000u);
}

TEST(Primitives, CapsulesEqualTheOracleInEveryBox) {
  const uint64_t seed = SeedOr(20);
  std::cout << "VOXELD_SEED=" << seed << "\n";
  SceneGenerator generator(seed);
  HardCoordinates hard(generator);
  const DenseVolume grid = Grid();
  size_t hits = 0;
  for (int i = 0; i < 400; ++i) {
    const int far = i % 3 == 0 ? 38 : 13;
    const OracleLine line{hard.Next(far), hard.Next(far), 0x102030, 0xFFEE01, LineSampling::kThin};
    const int64_t radius = generator.Int(1, i % 7 == 0 ? 4000 : 700);
    SCOPED_TRACE(absl::StrCat(Text(line.s), " to ", Text(line.e), ", radius ", radius));
    const Voxels want =
        FromOracle([&](const Plot& plot) { PlotCapsule(line, radius, grid, plot); });
    const Capsule ours =
        Capsule::Of({ToInt3(line.s), ToInt3(line.e), line.color_s, line.color_e}, radius);
    hits += want.size();
    ASSERT_TRUE(InBoxes(kSteps[generator.Int(0, 2)], [&](const Box3& box, const auto& emit) {
                  EmitCapsule(ours, box, emit);
                }) == want);
  }
  EXPECT_GT(hits, 6000u);
}

TEST(Primitives, TrianglesEqualTheOracleInEveryBox) {
  const uint64_t seed = SeedOr(30);
  std::cout << "VOXELD_SEED=" << seed << "\n";
  SceneGenerator generator(seed);
  HardCoordinates hard(generator);
  const DenseVolume grid = Grid();
  size_t hits = 0;
  for (int i = 0; i < 900; ++i) {
    const int far = i % 5 == 0 ? 38 : i % 5 == 1 ? 20 : 13;
    OracleTriangle t{{hard.Next(far), hard.Next(far), hard.Next(far)},
                     {0x102030, 0xFFEE01, 0x00FF80},
                     static_cast<SurfaceRule>(i % 2)};
    if (generator.Chance(0.1)) t.v[2] = t.v[0];  // no area
    SCOPED_TRACE(
        absl::StrCat(Text(t.v[0]), ", ", Text(t.v[1]), ", ", Text(t.v[2]), ", rule ", i % 2));
    const Voxels want = FromOracle([&](const Plot& plot) { PlotTriangle(t, grid, plot); });
    Triangle ours;
    for (int v = 0; v < 3; ++v) {
      ours.v[v] = ToInt3(t.v[v]);
      ours.color[v] = t.color[v];
    }
    ours.rule = t.rule;
    hits += want.size();
    ASSERT_TRUE(InBoxes(kSteps[generator.Int(0, 2)], [&](const Box3& box, const auto& emit) {
                  EmitTriangle(ours, box, emit);
                }) == want);
  }
  EXPECT_GT(hits, 6000u);
}

TEST(Primitives, ThickTrianglesEqualTheOracleInEveryBox) {
  const uint64_t seed = SeedOr(60);
  std::cout << "VOXELD_SEED=" << seed << "\n";
  SceneGenerator generator(seed);
  HardCoordinates hard(generator);
  const DenseVolume grid = Grid();
  size_t hits = 0;
  for (int i = 0; i < 600; ++i) {
    const int far = i % 5 == 0 ? 38 : i % 5 == 1 ? 31 : 13;
    OracleTriangle t{
        {hard.Next(far), hard.Next(far), hard.Next(far)}, {0x102030, 0xFFEE01, 0x00FF80}, {}};
    if (generator.Chance(0.1)) t.v[2] = t.v[0];  // no area
    const int64_t radius = generator.Int(1, i % 7 == 0 ? 4000 : 700);
    SCOPED_TRACE(
        absl::StrCat(Text(t.v[0]), ", ", Text(t.v[1]), ", ", Text(t.v[2]), ", radius ", radius));
    const Voxels want = FromOracle([&](const Plot& plot) { PlotThick(t, radius, grid, plot); });
    Triangle ours;
    for (int v = 0; v < 3; ++v) {
      ours.v[v] = ToInt3(t.v[v]);
      ours.color[v] = t.color[v];
    }
    hits += want.size();
    ASSERT_TRUE(InBoxes(kSteps[generator.Int(0, 2)], [&](const Box3& box, const auto& emit) {
                  EmitThick(ours, radius, box, emit);
                }) == want);
  }
  EXPECT_GT(hits, 20000u);
}

// The 64-bit and 128-bit versions must agree where both are allowed.
TEST(Primitives, NarrowTrianglesEqualWideOnes) {
  SceneGenerator generator(SeedOr(40));
  const Box3 box{{0, 0, 0}, {kSize, kSize, kSize}};
  for (int i = 0; i < 400; ++i) {
    Triangle t;
    for (Int3& v : t.v) {
      for (int64_t& c : v.v) c = generator.Int(-(1 << 17), 1 << 17);
    }
    t.rule = static_cast<SurfaceRule>(i % 2);
    Voxels narrow, wide;
    EmitTriangle(t, box, /*narrow=*/true, [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
      narrow[{x, y, z}][rgb] = true;
    });
    EmitTriangle(t, box, /*narrow=*/false, [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
      wide[{x, y, z}][rgb] = true;
    });
    ASSERT_TRUE(narrow == wide);
  }
}

// Every tile in which an item has a voxel must be among those that it is binned into.
TEST(Primitives, TilesHoldEveryVoxel) {
  const uint64_t seed = SeedOr(50);
  std::cout << "VOXELD_SEED=" << seed << "\n";
  SceneGenerator generator(seed);
  HardCoordinates hard(generator);
  const TileGrid grid = TileGrid::Of(75, 40, 50);
  const Box3 volume{{0, 0, 0}, {75, 40, 50}};
  for (int i = 0; i < 3000; ++i) {
    const int far = i % 3 == 0 ? 38 : 14;
    GeometryRecord record;
    record.kind = static_cast<PrimitiveKind>(1 + i % 3);
    record.sampling = static_cast<LineSampling>(i / 3 % 3);
    record.rule = static_cast<SurfaceRule>(i / 3 % 2);
    record.vertex_count = record.kind == PrimitiveKind::kPoints     ? 1
                          : record.kind == PrimitiveKind::kSegments ? 2
                                                                    : 3;
    const Int3 vertices[3] = {ToInt3(hard.Next(far)), ToInt3(hard.Next(far)),
                              ToInt3(hard.Next(far))};
    Source source;
    source.record = &record;
    source.vertices = vertices;
    source.radius = generator.Chance(0.3) ? generator.Int(1, 2000) : 0;
    WithPrimitive(record.kind, [&](auto primitive) {
      using Primitive = typename decltype(primitive)::type;
      ASSERT_EQ(Primitive::Count(source), 1u);
      std::vector<int> binned(grid.count());
      Primitive::EmitTiles(source, 0, grid, [&](uint32_t tile) { ++binned[tile]; });
      for (int count : binned) ASSERT_LE(count, 1);
      Primitive::EmitVoxels(source, 0, volume, [&](int32_t x, int32_t y, int32_t z, uint32_t) {
        ASSERT_EQ(binned[grid.Index(x / kTileSize, y / kTileSize, z / kTileSize)], 1)
            << "item " << i << ", voxel " << x << " " << y << " " << z;
      });
    });
    ASSERT_FALSE(testing::Test::HasFatalFailure());
  }
}

}  // namespace
}  // namespace voxeld::gpu::conformance
