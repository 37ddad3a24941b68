#include "gpu/clip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace voxeld::gpu {
namespace {

LayerRecord WithPlane(const ClipPlane& plane) {
  LayerRecord layer;
  layer.plane_count = 1;
  layer.planes[0] = plane;
  return layer;
}

VoxelHalfSpace HalfSpaceOf(const ClipPlane& plane, const Affine& view = {}) {
  const VoxelClip clip = MapClip(WithPlane(plane), view);
  EXPECT_EQ(clip.count, 1u);
  return clip.half_spaces[0];
}

constexpr int64_t kOne = int64_t{1} << 37;  // a component of a normal that is a power of two

TEST(Clip, NothingIsDrawnEverywhere) { EXPECT_EQ(MapClip({}, {}).count, 0u); }

TEST(Clip, HalfSpacesAreAsWorkedOutByHand) {
  const VoxelHalfSpace axis{{kOne, 0, 0}, -20 * kOne};  // 2x + 1 ≥ 20
  EXPECT_EQ(HalfSpaceOf({1, 0, 0, -10}), axis);
  EXPECT_EQ(HalfSpaceOf({8, 0, 0, -80}), axis);
  EXPECT_EQ(HalfSpaceOf({0x1p-900, 0, 0, -10 * 0x1p-900}), axis);
  EXPECT_EQ(HalfSpaceOf({1, -0.5, 0.25, 0}), (VoxelHalfSpace{{kOne, -kOne / 2, kOne / 4}, 0}));
  // Three quarters of the next lower power of two.
  EXPECT_EQ(HalfSpaceOf({0, 3, 0, -3}), (VoxelHalfSpace{{0, 3 * kOne / 2, 0}, -3 * kOne}));
  Affine view;  // scene x → voxel 2x + 5
  view.m[0] = view.m[5] = view.m[10] = 2;
  view.m[3] = 5;
  const VoxelHalfSpace moved = HalfSpaceOf({1, 0, 0, -10}, view);  // voxel ≥ 25
  EXPECT_TRUE(IsInside(moved, 25, 0, 0));
  EXPECT_FALSE(IsInside(moved, 24, 0, 0));
  EXPECT_EQ(moved.normal[0], kOne);
  EXPECT_EQ(moved.offset, -50 * kOne);
}

TEST(Clip, ARegionIsSixHalfSpacesAfterThePlanes) {
  LayerRecord layer = WithPlane({1, 0, 0, 0});
  layer.has_region = 1;
  layer.region = {{1, 2, 3}, {4, 5, 6}};
  const VoxelClip clip = MapClip(layer, {});
  ASSERT_EQ(clip.count, 7u);
  for (int64_t x = 0; x < 8; ++x) {
    for (int64_t y = 0; y < 8; ++y) {
      for (int64_t z = 0; z < 8; ++z) {
        bool inside = true;
        for (uint32_t i = 0; i < clip.count; ++i) {
          inside = inside && IsInside(clip.half_spaces[i], x, y, z);
        }
        EXPECT_EQ(inside, x >= 1 && x < 4 && y >= 2 && y < 5 && z >= 3 && z < 6);
      }
    }
  }
}

TEST(Clip, WhatIsFarSaturates) {
  EXPECT_EQ(HalfSpaceOf({1, 0, 0, 1e300}).offset, kMaxClipOffset);
  EXPECT_EQ(HalfSpaceOf({1, 0, 0, -1e300}).offset, -kMaxClipOffset);
  EXPECT_EQ(HalfSpaceOf({0x1p-1070, 0, 0, -1e300}).offset, -kMaxClipOffset);
  // Neither overflows anywhere in the largest grid.
  const VoxelHalfSpace far = HalfSpaceOf({1, 1, 1, 1e300}), near = HalfSpaceOf({-1, -1, -1, 1e300});
  for (int64_t at : {0, 16383, 1 << 18}) {
    EXPECT_TRUE(IsInside(far, at, at, at));
    EXPECT_TRUE(IsInside(near, at, at, at));
  }
}

TEST(Clip, AViewWithoutAnInverseHasNoInside) {
  Affine flat;
  flat.m[5] = 0;
  EXPECT_EQ(HalfSpaceOf({1, 0, 0, 5}, flat), NowhereInside());
  Affine huge;
  huge.m[0] = huge.m[5] = huge.m[10] = 1e200;
  EXPECT_EQ(HalfSpaceOf({1, 0, 0, 5}, huge), NowhereInside());
  EXPECT_FALSE(IsInside(NowhereInside(), 1, 2, 3));
  EXPECT_EQ(SideOf(NowhereInside(), {{0, 0, 0}, {16, 16, 16}}), ClipSide::kOutside);
}

class RandomClip : public testing::Test {
 protected:
  double Real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  int32_t Int(int32_t low, int32_t high) {
    return std::uniform_int_distribution<int32_t>(low, high)(random_);
  }
  Affine View() {
    Affine view;
    for (double& m : view.m) m = Real(-2, 2);
    for (int row = 0; row < 3; ++row) view.m[row * 4 + 3] = Real(-1000, 1000);
    return view;
  }
  Box3 SmallBox() {
    Box3 box;
    for (int a = 0; a < 3; ++a) {
      box.lo[a] = Int(0, 20);
      box.hi[a] = box.lo[a] + Int(1, 5);
    }
    return box;
  }
  std::mt19937_64 random_{5};
};

TEST_F(RandomClip, OppositesAreExactOpposites) {
  for (int i = 0; i < 10000; ++i) {
    const Affine view = View();
    const ClipPlane p{Real(-1, 1), Real(-1, 1), Real(-1, 1), Real(-100, 100)};
    const VoxelHalfSpace one = HalfSpaceOf(p, view);
    const VoxelHalfSpace other = HalfSpaceOf({-p.a, -p.b, -p.c, -p.d}, view);
    for (int a = 0; a < 3; ++a) ASSERT_EQ(one.normal[a], -other.normal[a]);
    ASSERT_EQ(one.offset, -other.offset);
  }
}

TEST_F(RandomClip, TheSideOfABoxIsThatOfAllItsVoxels) {
  int sides[3] = {};
  for (int i = 0; i < 20000; ++i) {
    const Box3 box = SmallBox();
    const double n[3] = {Real(-1, 1), Real(-1, 1), Int(0, 2) == 0 ? 0 : Real(-1, 1)};
    const VoxelHalfSpace h =
        HalfSpaceOf({n[0], n[1], n[2], -12 * (n[0] + n[1] + n[2]) + Real(-8, 8)});
    int inside = 0, all = 0;
    for (int32_t x = box.lo[0]; x < box.hi[0]; ++x) {
      for (int32_t y = box.lo[1]; y < box.hi[1]; ++y) {
        for (int32_t z = box.lo[2]; z < box.hi[2]; ++z, ++all) inside += IsInside(h, x, y, z);
      }
    }
    const ClipSide side = SideOf(h, box);
    ++sides[static_cast<int>(side)];
    ASSERT_EQ(side, inside == all ? ClipSide::kInside
                    : inside == 0 ? ClipSide::kOutside
                                  : ClipSide::kCut);
  }
  for (int count : sides) EXPECT_GT(count, 1000);
}

// Computed values keep their order, so the side of boxes that lie on one side of a cylinder is
// always known.
TEST_F(RandomClip, TheSideOfABoxIsThatOfAllItsVoxelsForCylindersToo) {
  int sides[3] = {};
  for (int i = 0; i < 20000; ++i) {
    const Box3 box = SmallBox();
    LayerRecord layer;
    layer.cylinder_count = 1;
    double* const m = layer.cylinders[0].unit.m;
    for (int k = 0; k < 12; ++k) m[k] = k % 4 == 3 ? Real(0, 24) : Real(-12, 12);
    if (i % 3 == 0) m[2] = m[6] = m[8] = m[9] = 0, m[10] = 1;  // along z
    const VoxelClip clip = MapClip(layer, {});
    ASSERT_EQ(clip.cylinder_count, 1u);
    int inside = 0, all = 0;
    for (int32_t x = box.lo[0]; x < box.hi[0]; ++x) {
      for (int32_t y = box.lo[1]; y < box.hi[1]; ++y) {
        for (int32_t z = box.lo[2]; z < box.hi[2]; ++z, ++all) {
          inside += IsInside(clip.cylinders[0], x, y, z);
        }
      }
    }
    const ClipSide side = SideOf(clip.cylinders[0], box);
    ++sides[static_cast<int>(side)];
    // For boxes that touch it near one of their corners, the side is not known, only that they may
    // be clipped.
    if (side == ClipSide::kInside) {
      ASSERT_EQ(inside, all);
    } else if (side == ClipSide::kOutside) {
      ASSERT_EQ(inside, 0);
    }
  }
  for (int count : sides) EXPECT_GT(count, 500);
}

TEST(Clip, CylindersAreAsWorkedOutByHand) {
  LayerRecord layer;
  layer.cylinder_count = 1;
  layer.cylinders[0].unit = {
      {3, 0, 0, 4.5, 0, 3, 0, 4.5, 0, 0, 1, 0}};  // of radius 3 around (4.5, 4.5)
  Affine view;
  view.m[11] = 100;  // along its axis: nothing changes
  const VoxelClip clip = MapClip(layer, view);
  EXPECT_EQ(clip.count, 0u);
  const VoxelCylinder& c = clip.cylinders[0];
  EXPECT_TRUE(IsInside(c, 4, 4, 0));
  EXPECT_TRUE(IsInside(c, 7, 4, 200)) << "on its side";
  EXPECT_TRUE(IsInside(c, 6, 6, 5));
  EXPECT_FALSE(IsInside(c, 7, 5, 5));
  EXPECT_FALSE(IsInside(c, 8, 4, 5));
  layer.cylinders[0].unit.m[0] = 0;
  const VoxelClip none = MapClip(layer, view);
  EXPECT_FALSE(IsInside(none.cylinders[0], 4, 4, 0));
  EXPECT_EQ(SideOf(none.cylinders[0], {{0, 0, 0}, {16, 16, 16}}), ClipSide::kOutside);
}

// In the largest grid, the error that clip.h states: centres at that distance or farther are on the
// plane's true side.
TEST_F(RandomClip, RoundingMovesAPlaneByNoMoreThanStated) {
  constexpr int32_t kCells = 16384;
  long double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const double n[3] = {Real(-1, 1), Real(-1, 1), Real(-1, 1)};
    const int32_t v[3] = {Int(0, kCells - 1), Int(0, kCells - 1), Int(0, kCells - 1)};
    long double value = 0;
    for (int a = 0; a < 3; ++a) value -= n[a] * (v[a] + 0.5L);
    const auto d = static_cast<double>(value);
    value = d - value;  // the remainder at the centre of v
    const VoxelHalfSpace h = HalfSpaceOf({n[0], n[1], n[2], d});
    int major = 0;
    for (int a = 1; a < 3; ++a) {
      if (std::fabs(n[a]) > std::fabs(n[major])) major = a;
    }
    // Both in voxels along the greatest axis.
    const long double exact = value / std::fabs(n[major]);
    const long double rounded = static_cast<long double>(ClipValue(h, v[0], v[1], v[2])) /
                                static_cast<long double>(2 * std::abs(h.normal[major]));
    worst = std::max(worst, std::fabs(exact - rounded));
  }
  EXPECT_LE(worst, (3 * kCells + 1) * 0x1p-38L);
  EXPECT_GT(worst, 0x1p-30L) << "the test sees the rounding";
}

}  // namespace
}  // namespace voxeld::gpu
