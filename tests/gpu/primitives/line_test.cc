// Tests properties of lines that the definition promises.
#include "gpu/primitives/line.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "gpu/primitives/capsule.h"
#include "tests/gpu/primitives/voxel_set.h"

namespace voxeld::gpu {
namespace {

const Box3 kBox = Cube(-64, 64);

class Lines {
 public:
  explicit Lines(uint64_t seed) : random_(seed) {}
  Line Next(LineSampling sampling) {
    const int64_t reach = int64_t{1} << std::uniform_int_distribution<int>(6, 13)(random_);
    std::uniform_int_distribution<int64_t> unit(-reach, reach);
    Line line;
    for (int a = 0; a < 3; ++a) {
      line.s[a] = unit(random_);
      line.e[a] = unit(random_) % 5 == 0 ? line.s[a] : unit(random_);
    }
    line.sampling = sampling;
    return line;
  }

 private:
  std::mt19937_64 random_;
};

VoxelSet VoxelsOf(const Line& line) {
  VoxelSet set;
  EmitLine(line, kBox, Into(set));
  return set;
}

Voxel CellOf(const Int3& p) {
  return {static_cast<int32_t>(VoxelOf(p[0])), static_cast<int32_t>(VoxelOf(p[1])),
          static_cast<int32_t>(VoxelOf(p[2]))};
}

TEST(ThinLine, InnerVoxelsHaveTwoNeighboursAndNoMore) {
  Lines lines(1);
  for (int i = 0; i < 2000; ++i) {
    const Line line = lines.Next(LineSampling::kThin);
    const VoxelSet set = VoxelsOf(line);
    ASSERT_TRUE(set.contains(CellOf(line.s)) && set.contains(CellOf(line.e)));
    int ends = 0;
    for (const Voxel& v : set) {
      int neighbours = 0;
      for (const Voxel& s : Neighbours(26)) {
        neighbours += set.contains({v[0] + s[0], v[1] + s[1], v[2] + s[2]});
      }
      const bool end = v == CellOf(line.s) || v == CellOf(line.e);
      ends += end;
      ASSERT_EQ(neighbours, set.size() == 1 ? 0 : end ? 1 : 2) << "line " << i;
    }
    ASSERT_LE(ends, 2);
  }
}

TEST(Line, IsTheSameFromBothEnds) {
  Lines lines(2);
  for (int i = 0; i < 3000; ++i) {
    const Line line = lines.Next(static_cast<LineSampling>(i % 3));
    Line back = line;
    std::swap(back.s, back.e);
    ASSERT_TRUE(VoxelsOf(line) == VoxelsOf(back)) << "line " << i;
  }
}

TEST(CoverLine, EachVoxelSharesAFaceWithTheNext) {
  Lines lines(3);
  for (int i = 0; i < 2000; ++i) {
    const Line line = lines.Next(LineSampling::kCover);
    std::vector<Voxel> way;
    EmitLine(line, kBox, [&](int32_t x, int32_t y, int32_t z, uint32_t) {
      const Voxel v = {x, y, z};
      if (way.empty() || way.back() != v) way.push_back(v);
    });
    int64_t steps = 0;
    for (int a = 0; a < 3; ++a) steps += Abs(VoxelOf(line.e[a]) - VoxelOf(line.s[a]));
    ASSERT_EQ(static_cast<int64_t>(way.size()), steps + 1);
    for (size_t k = 1; k < way.size(); ++k) {
      int distance = 0;
      for (size_t a = 0; a < 3; ++a) distance += std::abs(way[k][a] - way[k - 1][a]);
      ASSERT_EQ(distance, 1);
    }
    const VoxelSet set(way.begin(), way.end());
    ASSERT_TRUE(set.contains(CellOf(line.s)) && set.contains(CellOf(line.e)));
  }
}

// Through corners: x before y before z from the smaller end, including each cell in between.
TEST(CoverLine, CrossesCornersAxisByAxis) {
  const Line line{
      {{128, 128, 128}}, {{128 + 512, 128 + 512, 128 + 512}}, 0, 0, LineSampling::kCover};
  const VoxelSet want = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, 1, 1},
                         {2, 1, 1}, {2, 2, 1}, {2, 2, 2}};
  EXPECT_TRUE(VoxelsOf(line) == want);
}

// |E−S| = 5 voxels: six samples, of which THIN needs five (N = 4).
TEST(EuclideanLine, HasAsManyStepsAsItIsLong) {
  const Line line{{{0, 0, 0}}, {{4 * 256, 3 * 256, 0}}, 0, 0, LineSampling::kEuclidean};
  EXPECT_EQ(LineSteps(line), 5);
  const VoxelSet want = {{0, 0, 0}, {1, 1, 0}, {2, 1, 0}, {3, 2, 0}, {4, 3, 0}, {0, 0, 0}};
  VoxelSet got = VoxelsOf(line);
  // k = 1: (0.8, 0.6), k = 2: (1.6, 1.2), k = 3: (2.4, 1.8), k = 4: (3.2, 2.4).
  const VoxelSet by_hand = {{0, 0, 0}, {1, 1, 0}, {2, 1, 0}, {3, 2, 0}, {4, 3, 0}};
  EXPECT_TRUE(got == by_hand);
  EXPECT_TRUE(want == by_hand);
}

TEST(Line, ShiftedByWholeVoxelsShiftsItsVoxels) {
  Lines lines(4);
  std::mt19937 random(5);
  std::uniform_int_distribution<int> shift(-20, 20);
  for (int i = 0; i < 1500; ++i) {
    Line line = lines.Next(static_cast<LineSampling>(i % 3));
    const Voxel by = {shift(random), shift(random), shift(random)};
    VoxelSet before, after;
    EmitLine(line, kBox, Into(before));
    EmitCapsule(Capsule::Of(line, 1 + i % 900), Cube(-30, 30), Into(before));
    for (size_t a = 0; a < 3; ++a) {
      line.s.v[a] += by[a] * 256;
      line.e.v[a] += by[a] * 256;
    }
    const Box3 moved{{-30 + by[0], -30 + by[1], -30 + by[2]}, {30 + by[0], 30 + by[1], 30 + by[2]}};
    EmitLine(line, Cube(-90, 90), Into(after));
    EmitCapsule(Capsule::Of(line, 1 + i % 900), moved, Into(after));
    ASSERT_TRUE(Shifted(before, by) == after) << "line " << i;
  }
}

TEST(Line, OfNoLengthGivesItsEndsInTheirColours) {
  std::vector<uint32_t> colors;
  const Line line{{{10, 20, 30}}, {{40, 50, 60}}, 0x111111, 0x222222, LineSampling::kThin};
  for (LineSampling sampling :
       {LineSampling::kThin, LineSampling::kEuclidean, LineSampling::kCover}) {
    Line l = line;
    l.sampling = sampling;
    colors.clear();
    EmitLine(l, kBox, [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
      EXPECT_EQ(x | y | z, 0);
      colors.push_back(rgb);
    });
    EXPECT_EQ(colors, (std::vector<uint32_t>{0x111111, 0x222222}));
  }
}

// A ball of diameter 3 around a voxel's centre: the centre, 6 at distance 1 and 12 at √2.
TEST(Capsule, OfNoLengthIsABall) {
  const Line point{{{128, 128, 128}}, {{128, 128, 128}}};
  VoxelSet ball;
  EmitCapsule(Capsule::Of(point, 384), kBox, Into(ball));
  EXPECT_EQ(ball.size(), 19u);
  ball.clear();
  EmitCapsule(Capsule::Of(point, 256), kBox, Into(ball));  // closed: those at distance 1
  EXPECT_EQ(ball.size(), 7u);
}

}  // namespace
}  // namespace voxeld::gpu
