// Tests test patterns, drawn by the CPU engine and checked voxel by voxel.
#include "daemon/pipeline/test_pattern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <array>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "daemon/pipeline/slice_numbers.h"
#include "daemon/scene/engine_delta.h"
#include "display/geometry/footprint.h"
#include "gpu/engine.h"

namespace voxeld::daemon {
namespace {

constexpr int kNx = 20, kNy = 12, kNz = 10;

display::Geometry Stack() {
  display::PlanarStack stack;
  stack.width_px = kNx;
  stack.height_px = kNy;
  for (int i = 0; i < kNz; ++i) stack.positions_mm.push_back(i + 0.5 - kNz / 2.0);
  return {stack, {kNx, kNy, kNz, {1, 1, 1}, {-kNx / 2.0, -kNy / 2.0, -kNz / 2.0}}};
}

class Drawn {
 public:
  explicit Drawn(TestPattern pattern, const display::Geometry& geometry = Stack()) {
    gpu::EngineOptions options;
    options.kind = gpu::EngineKind::kCpu;
    options.threads = 1;
    options.inline_execution = true;
    auto engine = *gpu::CreateEngine(options);
    gpu::Target target;
    target.geometry = geometry;
    target.tone.SetCurve(display::Tone::Linear());
    target.layout.slices = display::SliceCount(geometry);
    std::visit(
        [&](const auto& shape) {
          target.layout.width = shape.width_px;
          target.layout.height = shape.height_px;
        },
        geometry.shape);
    const auto ok = [](const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; };
    engine->SetTarget(target, ok);
    EngineScene scene;
    const size_t size = scene.Plan(MakePattern(pattern, target.geometry, 1));
    gpu::StagingBlock block = *engine->AcquireStaging(size);
    gpu::DeltaWriter writer(block.bytes());
    scene.Write(writer);
    engine->Apply(std::move(block), size, ok);
    voxels_.resize(kNx * kNy * kNz);
    engine->ReadVoxels({0, 0, 0, kNx, kNy, kNz}, voxels_, ok);
    pictures_.resize(target.layout.bytes());
    std::vector<uint64_t> changed_in(target.layout.pictures());
    engine->SubmitFrame({.frame = 1}, {pictures_, changed_in},
                        [&](const auto& result) { ok(result.status()); });
  }
  uint32_t At(int x, int y, int z) const { return voxels_[(z * kNy + y) * kNx + x]; }
  std::map<uint32_t, int> Colors() const {
    std::map<uint32_t, int> colors;
    for (const uint32_t voxel : voxels_) ++colors[voxel];
    return colors;
  }

  // Returns the light of a lattice's lights, by pixel.
  std::vector<uint32_t> Lights() const {
    std::vector<uint32_t> lights;
    for (size_t i = 0; i < pictures_.size(); i += 3) {
      lights.push_back(uint32_t(pictures_[i]) << 16 | uint32_t(pictures_[i + 1]) << 8 |
                       uint32_t(pictures_[i + 2]));
    }
    return lights;
  }

 private:
  std::vector<uint32_t> voxels_;
  std::vector<std::byte> pictures_;
};

// Lights on a ring that stands in the grid, without lights in its middle or at its corners; two
// slices.
display::Geometry Ring() {
  display::Lattice lattice;
  lattice.width_px = 20;
  for (int n = 0; n < 39; ++n) {
    const double turn = n * 2 * std::numbers::pi / 39;
    lattice.points_mm.push_back(display::Vec3{9 * std::cos(turn), 0.3, 4.5 * std::sin(turn)});
  }
  lattice.points_mm.insert(lattice.points_mm.begin() + 7, std::nullopt);
  return {lattice, Stack().grid};
}

TEST(TestPattern, WhiteIsEveryVoxel) {
  EXPECT_THAT(Drawn(TestPattern::kWhite).Colors(),
              ::testing::ElementsAre(std::pair<const uint32_t, int>(0xFFFFFF, kNx * kNy * kNz)));
}

TEST(TestPattern, AxesPointFromTheMiddleToThePositiveFaces) {
  const Drawn drawn(TestPattern::kAxes);
  EXPECT_EQ(drawn.At(kNx - 1, kNy / 2, kNz / 2), 0xFF0000u);
  EXPECT_EQ(drawn.At(kNx / 2, kNy - 1, kNz / 2), 0x00FF00u);
  EXPECT_EQ(drawn.At(kNx / 2, kNy / 2, kNz - 1), 0x0000FFu);
  EXPECT_EQ(drawn.At(0, kNy / 2, kNz / 2), 0u);
  EXPECT_EQ(drawn.At(kNx / 2, 0, kNz / 2), 0u);
  EXPECT_EQ(drawn.At(kNx / 2, kNy / 2, 0), 0u);
}

TEST(TestPattern, CornersDifferInColourAndEdgesJoinThem) {
  const Drawn drawn(TestPattern::kCorners);
  std::set<uint32_t> colors;
  for (const int x : {0, kNx - 1}) {
    for (const int y : {0, kNy - 1}) {
      for (const int z : {0, kNz - 1}) colors.insert(drawn.At(x, y, z));
    }
  }
  EXPECT_EQ(colors.size(), 8u);
  EXPECT_FALSE(colors.contains(0));
  for (int x = 2; x < kNx - 2; ++x) {
    for (const int y : {0, kNy - 1}) {
      for (const int z : {0, kNz - 1}) EXPECT_EQ(drawn.At(x, y, z), 0x808080u);
    }
  }
  EXPECT_EQ(drawn.At(kNx / 2, kNy / 2, kNz / 2), 0u);
}

TEST(TestPattern, GridIsDotsEightApart) {
  const Drawn drawn(TestPattern::kGrid);
  EXPECT_EQ(drawn.At(4, 4, 4), 0xFFFFFFu);
  EXPECT_EQ(drawn.At(12, 4, 4), 0xFFFFFFu);
  EXPECT_EQ(drawn.Colors()[0xFFFFFF], 2);  // 4 and 12 in x, 4 in y, 4 in z (the next would be 12)
}

TEST(TestPattern, RampRisesAlongX) {
  const Drawn drawn(TestPattern::kRamp);
  uint32_t last = 0;
  for (int x = 0; x < kNx; ++x) {
    const uint32_t level = drawn.At(x, 3, kNz / 2) & 0xFF;
    EXPECT_EQ(drawn.At(x, 3, kNz / 2), level << 16 | level << 8 | level);
    EXPECT_TRUE(x == 0 || level > last);
    last = level;
  }
  EXPECT_EQ(last, 255u);
}

TEST(TestPattern, ALatticesCornersAreLights) {
  const Drawn drawn(TestPattern::kCorners, Ring());
  const std::vector<uint32_t> lights = drawn.Lights();
  ASSERT_EQ(lights.size(), 40u);
  EXPECT_EQ(lights[7], 0u);  // no light is there
  std::set<uint32_t> colors(lights.begin(), lights.end());
  // The ring is flat: a corner in front and the one behind it share a light, which has the greater
  // colour.
  for (const uint32_t color : {0xFFFFFFu, 0xFFFF00u, 0x00FFFFu, 0xFF8000u}) {
    EXPECT_TRUE(colors.contains(color)) << std::hex << color;
  }
}

TEST(TestPattern, ALatticesGridIsEveryEighthPixelOfEachSlice) {
  const std::vector<uint32_t> lights = Drawn(TestPattern::kGrid, Ring()).Lights();
  for (size_t pixel = 0; pixel < lights.size(); ++pixel) {
    if (pixel % 20 % 8 == 0) {
      EXPECT_EQ(lights[pixel], 0xFFFFFFu) << pixel;
    }
  }
  EXPECT_LT(std::count(lights.begin(), lights.end(), 0xFFFFFFu), 12);  // some share a voxel
}

TEST(TestPattern, ALatticesRampReachesEveryLight) {
  const display::Geometry ring = Ring();
  const std::vector<uint32_t> lights = Drawn(TestPattern::kRamp, ring).Lights();
  const auto& points = std::get<display::Lattice>(ring.shape).points_mm;
  for (size_t a = 0; a < points.size(); ++a) {
    if (!points[a].has_value()) continue;
    EXPECT_NE(lights[a], 0u) << a;
    for (size_t b = 0; b < points.size(); ++b) {
      if (points[b].has_value() && points[a]->x + 1 < points[b]->x) {
        EXPECT_LT(lights[a], lights[b]) << a << " " << b;
      }
    }
  }
}

TEST(TestPattern, ALatticeIsAllWhite) {
  std::vector<uint32_t> lights = Drawn(TestPattern::kWhite, Ring()).Lights();
  EXPECT_EQ(std::count(lights.begin(), lights.end(), 0xFFFFFFu), 39);
}

TEST(TestPattern, BarsAreEightColoursAlongX) {
  const Drawn drawn(TestPattern::kBars);
  EXPECT_EQ(drawn.At(0, 3, 4), 0xFFFFFFu);
  EXPECT_EQ(drawn.At(2, 0, 9), 0xFFFF00u);  // bars of 2 and 3 voxels in turn
  EXPECT_EQ(drawn.At(16, 11, 0), 0x0000FFu);
  EXPECT_EQ(drawn.At(kNx - 1, 3, 4), 0u);
  EXPECT_EQ(drawn.Colors().size(), 8u);
}

TEST(TestPattern, DensityIsARampInTheWholeVolume) {
  const Drawn drawn(TestPattern::kDensity);
  for (int x = 0; x < kNx; ++x) {
    const uint32_t level = static_cast<uint32_t>(x * 255 / (kNx - 1));
    for (const int y : {0, kNy - 1}) EXPECT_EQ(drawn.At(x, y, 3), level * 0x010101);
  }
}

// A slice with a resolution of its own: the voxels are the digits' pixels, three wide and five
// high.
TEST(TestPattern, SlicesShowTheirNumbers) {
  const Drawn drawn(TestPattern::kSlices);
  const auto picture = [&](int x0, int z) {
    std::vector<std::string> rows;
    for (int y = 7; y >= 3; --y) {
      std::string row;
      for (int x = x0; x < x0 + 3; ++x) row += drawn.At(x, y, z) != 0 ? '#' : '.';
      rows.push_back(row);
    }
    return rows;
  };
  EXPECT_THAT(picture(0, 0), ::testing::ElementsAre("###", "#.#", "#.#", "#.#", "###"));
  EXPECT_THAT(picture(5, 1), ::testing::ElementsAre(".#.", "##.", ".#.", ".#.", "###"));
  EXPECT_THAT(picture(15, 7), ::testing::ElementsAre("###", "..#", "..#", ".#.", ".#."));
  EXPECT_EQ(drawn.At(0, 3, 0), 0xFF0000u);
  EXPECT_EQ(drawn.At(5, 3, 1), 0x00FF00u);
}

TEST(TestPattern, SlicesOfALatticeBeginWithWhite) {
  const std::vector<uint32_t> lights = Drawn(TestPattern::kSlices, Ring()).Lights();
  EXPECT_EQ(lights[0], 0xFFFFFFu);
  EXPECT_EQ(lights[1], 0xFF0000u);
  EXPECT_EQ(lights[7], 0u);  // no light is there
  EXPECT_EQ(lights[20], 0xFFFFFFu);
  EXPECT_EQ(lights[21], 0x00FF00u);
}

// Every pixel of a number is lit in its own slice, in every geometry.
TEST(TestPattern, NumbersStandInTheirSlices) {
  display::Rotor rotor;
  rotor.slices_per_turn = 40;
  rotor.width_px = 48;
  rotor.height_px = 24;
  rotor.panels.resize(2);
  rotor.panels[1].eccentricity_mm = 3;
  rotor.panels[1].mirror_u = true;
  display::Helix helix;
  helix.slices_per_turn = 60;
  helix.width_px = helix.height_px = 48;
  helix.height_mm = 40;
  helix.radius_mm = 24;
  for (display::Geometry geometry : {display::Geometry{rotor, {}}, display::Geometry{helix, {}}}) {
    geometry.grid = display::DefaultGrid(geometry);
    const std::vector<NumberedVoxel> voxels = SliceNumbers(geometry);
    EXPECT_GT(voxels.size(), 300u);
    std::map<std::array<int, 3>, uint32_t> colours;
    for (const NumberedVoxel& voxel : voxels) {
      const std::array<int, 3> cell = {int(voxel.at.x), int(voxel.at.y), int(voxel.at.z)};
      EXPECT_EQ(colours.try_emplace(cell, voxel.rgb).first->second, voxel.rgb)
          << "two numbers in one voxel";
      EXPECT_TRUE(voxel.at.x >= 0 && voxel.at.x < geometry.grid.nx && voxel.at.y >= 0 &&
                  voxel.at.y < geometry.grid.ny && voxel.at.z >= 0 &&
                  voxel.at.z < geometry.grid.nz);
    }
  }
}

}  // namespace
}  // namespace voxeld::daemon
