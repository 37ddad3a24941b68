// Compares the voxels of points in 32 bits with those in 64.
#include "gpu/primitives/compact_point.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace voxeld::gpu {
namespace {

TEST(VoxelNear, IsTheVoxelThatAPositionSnapsTo) {
  const auto expect = [](double at) { EXPECT_EQ(VoxelNear(at), VoxelOf(Snap(at))) << at; };
  std::mt19937_64 random(7);
  for (int i = 0; i < 100'000; ++i) {
    expect(std::uniform_real_distribution<double>(-kMostNear, kMostNear)(random));
    expect(std::uniform_real_distribution<double>(-3, 3)(random));
  }
  // On and beside every place where rounding changes, and the faces of voxels.
  for (const double middle : {-kMostNear, -513.0, -1.0, 0.0, 1.0, 512.0, kMostNear - 1}) {
    for (int half = -1; half <= 513; ++half) {
      const double at = middle + half / 512.0;
      expect(at);
      expect(std::nextafter(at, -1e9));
      expect(std::nextafter(at, 1e9));
    }
  }
}

TEST(AreNear, KnowsItsBounds) {
  const double near[3] = {-1, kMostNear - 1, 3}, far[3] = {2, kMostNear, 4},
               nan[3] = {0, std::numeric_limits<double>::quiet_NaN(), 0},
               low[3] = {-kMostNear, 0, 0}, least[3] = {-kMostNear + 1, 0, 0};
  EXPECT_TRUE(AreNear(least, near));
  EXPECT_FALSE(AreNear(least, far));
  EXPECT_FALSE(AreNear(low, near));
  EXPECT_FALSE(AreNear(least, nan));
  EXPECT_FALSE(AreNear(nan, near));
}

}  // namespace
}  // namespace voxeld::gpu
