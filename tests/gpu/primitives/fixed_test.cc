#include "gpu/primitives/fixed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "gpu/primitives/source.h"

namespace voxeld::gpu {
namespace {

TEST(Fixed, DivisionRoundsTowardsInfinities) {
  for (int a = -20; a <= 20; ++a) {
    for (int b = 1; b <= 7; ++b) {
      EXPECT_EQ(FloorDiv(a, b), static_cast<int>(std::floor(static_cast<double>(a) / b)));
      EXPECT_EQ(CeilDiv(a, b), static_cast<int>(std::ceil(static_cast<double>(a) / b)));
    }
  }
}

TEST(Fixed, SnapsToTheNearestUnitHalvesUpAndSaturates) {
  EXPECT_EQ(Snap(0), 0);
  EXPECT_EQ(Snap(1), 256);
  EXPECT_EQ(Snap(0.5 / 256), 1);
  EXPECT_EQ(Snap(-0.5 / 256), 0);
  EXPECT_EQ(Snap(-0.51 / 256), -1);
  EXPECT_EQ(Snap(-1.0 / 3), -85);
  EXPECT_EQ(Snap(1e300), kMaxUnits);
  EXPECT_EQ(Snap(-1e300), -kMaxUnits);
  EXPECT_EQ(Snap(std::numeric_limits<double>::infinity()), kMaxUnits);
  EXPECT_EQ(Snap(std::numeric_limits<double>::quiet_NaN()), -kMaxUnits);
  EXPECT_EQ(Snap(1073741824.0), kMaxUnits);
}

TEST(Fixed, SquareRootsAreExact) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 2000; ++i) {
    const int64_t r = static_cast<int64_t>(random() >> (23 + i % 40));
    const Wide square = static_cast<Wide>(r) * r;
    EXPECT_EQ(FloorSqrt(square), r);
    EXPECT_EQ(FloorSqrt(square + 2 * static_cast<Wide>(r)), r);
    if (r > 0) {
      EXPECT_EQ(FloorSqrt(square - 1), r - 1);
    }
  }
}

TEST(Fixed, StepperEqualsDivision) {
  std::mt19937_64 random(2);
  const auto number = [&](int64_t low, int64_t high) {
    return std::uniform_int_distribution<int64_t>(low, high)(random);
  };
  for (int i = 0; i < 300; ++i) {
    const int64_t modulus = number(1, 5000), step = number(-2 * modulus, 2 * modulus);
    const int64_t start = number(-1000000, 1000000);
    Stepper s = Stepper::At<int64_t>(start, step, modulus);
    for (int64_t k = 0; k < 50; ++k, s.Next()) {
      ASSERT_EQ(s.value, FloorDiv<int64_t>(start + step * k, modulus));
    }
  }
}

TEST(Fixed, ColoursMixByTheFormula) {
  EXPECT_EQ(MixColors(0x000000, 0xFF0000, 1, 2), 0x800000u);  // (255 + 1)/2
  EXPECT_EQ(MixColors(0x0000FF, 0x00FF00, 0, 7), 0x0000FFu);
  EXPECT_EQ(MixColors(0x0000FF, 0x00FF00, 7, 7), 0x00FF00u);
  EXPECT_EQ(MixColors(0x0000FF, 0x00FF00, 3, 7), 0x006D92u);  // (765 + 3)/7, (1020 + 3)/7
}

TEST(Fixed, CubeRootsAreCloseEverywhere) {
  for (double x = 1e-12; x < 1e12; x *= 1.37) {
    EXPECT_NEAR(CubeRoot(x), std::cbrt(x), std::cbrt(x) * 1e-15);
  }
  EXPECT_EQ(CubeRoot(0), 0);
  EXPECT_EQ(CubeRoot(-1), 0);
}

TEST(Fixed, ThicknessInUnitsFollowsTheMap) {
  GeometryRecord g;
  g.thickness = 3;
  Affine map;
  map.m[0] = 2;
  map.m[5] = -4;
  map.m[10] = 1;
  EXPECT_EQ(RadiusOf(g, map), 384);
  g.thickness_unit = ThicknessUnit::kUnits;
  EXPECT_EQ(RadiusOf(g, map), 768);  // ∛8 = 2
  g.thickness = 0;
  EXPECT_EQ(RadiusOf(g, map), 0);
}

}  // namespace
}  // namespace voxeld::gpu
