// Compares thin lines with the definition: each coordinate of each voxel as a quotient of 128-bit
// numbers.
#include "gpu/primitives/thin_line.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "tests/gpu/primitives/voxel_set.h"

namespace voxeld::gpu {
namespace {

constexpr int64_t kMostUnits = int64_t{1} << 22;  // ±2¹⁴ voxels
constexpr int kBits[3] = {5, 5, 4};
constexpr int kFarBits[3] = {7, 7, 6};

std::vector<Voxel> Defined(const Line& line) {
  const int64_t n = LineSteps(line);
  std::vector<Voxel> voxels;
  if (n == 0) {
    for (const Int3* p : {&line.s, &line.e}) {
      const Voxel voxel = {static_cast<int32_t>(VoxelOf((*p)[0])),
                           static_cast<int32_t>(VoxelOf((*p)[1])),
                           static_cast<int32_t>(VoxelOf((*p)[2]))};
      if (voxels.empty() || voxels.back() != voxel) voxels.push_back(voxel);
    }
    return voxels;
  }
  for (int64_t k = 0; k <= n; ++k) {
    Voxel voxel;
    for (int a = 0; a < 3; ++a) {
      const Wide top =
          static_cast<Wide>(line.s[a]) * n + static_cast<Wide>(line.e[a] - line.s[a]) * k;
      voxel[static_cast<size_t>(a)] = static_cast<int32_t>(FloorDiv<Wide>(top, Wide{256} * n));
    }
    voxels.push_back(voxel);
  }
  return voxels;
}

// Adds the voxels of a span, and checks that it is in its box.
void AddSpan(const ThinLine& line, const int32_t box[3], int32_t begin, int32_t end,
             std::vector<Voxel>& voxels) {
  ASSERT_LT(begin, end);
  ASSERT_LE(end - begin, static_cast<int32_t>(kMaxSpan));
  ThinCursor at(TrackOf(line), begin);
  for (int32_t k = begin; k < end; ++k, at.Next()) {
    Voxel voxel;
    for (int a = 0; a < 3; ++a) {
      ASSERT_LT(at.voxel(a), 1u << kBits[a]) << "axis " << a << ", k " << k;
      voxel[static_cast<size_t>(a)] = box[a] * (1 << kBits[a]) + static_cast<int32_t>(at.voxel(a));
    }
    voxels.push_back(voxel);
  }
}

std::vector<Voxel> Walked(const Line& line) {
  const ThinLine thin = MakeThin(line, 1);
  std::vector<Voxel> voxels;
  int32_t at[3];
  for (int a = 0; a < 3; ++a) at[a] = thin.s[a] >> (8 + kBits[a]);
  WalkThin(thin, 0, at, kBits, [&](const int32_t box[3], int32_t k, int32_t end) {
    AddSpan(thin, box, k, end, voxels);
    return true;
  });
  return voxels;
}

// By way of boxes four times as large, as for lines that are sorted in two steps.
std::vector<Voxel> WalkedTwice(const Line& line) {
  const ThinLine thin = MakeThin(line, 1);
  std::vector<Voxel> voxels;
  int32_t far[3];
  for (int a = 0; a < 3; ++a) far[a] = thin.s[a] >> (8 + kFarBits[a]);
  WalkThin(thin, 0, far, kFarBits, [&](const int32_t box[3], int32_t k, int32_t end) {
    int32_t at[3];
    for (int a = 0; a < 3; ++a) at[a] = BoxAt(thin, a, k, kBits[a]);
    WalkThin(thin, k, at, kBits, [&](const int32_t near[3], int32_t begin, int32_t) {
      for (int a = 0; a < 3; ++a) {
        if (near[a] >> 2 != box[a]) {
          EXPECT_EQ(begin, end);
          return false;
        }
      }
      return true;
    });
    WalkThin(thin, k, at, kBits, [&](const int32_t near[3], int32_t begin, int32_t stop) {
      if (begin == end) return false;
      AddSpan(thin, near, begin, stop, voxels);
      return true;
    });
    return true;
  });
  return voxels;
}

void Check(const Line& line) {
  const std::vector<Voxel> defined = Defined(line);
  ASSERT_EQ(Walked(line), defined) << "from " << line.s[0] << ", " << line.s[1] << ", " << line.s[2]
                                   << " to " << line.e[0] << ", " << line.e[1] << ", " << line.e[2];
  ASSERT_EQ(WalkedTwice(line), defined);
}

class ThinLines : public ::testing::TestWithParam<LineSampling> {};

TEST_P(ThinLines, AreTheDefinedVoxelsForRandomEnds) {
  std::mt19937_64 random(2711);
  for (int i = 0; i < 20000; ++i) {
    const int bits = std::uniform_int_distribution<int>(3, 20)(random);
    std::uniform_int_distribution<int64_t> reach(-(int64_t{1} << bits), int64_t{1} << bits);
    std::uniform_int_distribution<int64_t> place(-kMostUnits / 2, kMostUnits / 2);
    Line line;
    line.sampling = GetParam();
    for (int a = 0; a < 3; ++a) {
      line.s[a] = place(random) / 2;
      line.e[a] = line.s[a] + reach(random);
    }
    if (LineSteps(line) > kMaxThinSteps) continue;
    Check(line);
  }
}

// Ends on faces and centres of voxels and of boxes, and a unit beside them; equal and opposite
// slopes, so that faces are met at the same time.
TEST_P(ThinLines, AreTheDefinedVoxelsForEndsOnFaces) {
  std::mt19937_64 random(99);
  const int64_t grains[] = {1, 128, 256, 4096, 8192, 32768};
  for (int i = 0; i < 20000; ++i) {
    Line line;
    line.sampling = GetParam();
    const int64_t length = std::uniform_int_distribution<int64_t>(0, 300)(random);
    for (int a = 0; a < 3; ++a) {
      const int64_t grain = grains[random() % 6];
      line.s[a] = static_cast<int64_t>(random() % 200) * grain % 500000 - 250000 +
                  static_cast<int64_t>(random() % 3) - 1;
      const int64_t step[] = {0, 1, -1, 2, -2};
      line.e[a] = line.s[a] + step[random() % 5] * length * 256 + (random() % 4 == 0 ? grain : 0);
    }
    Check(line);
  }
}

// The greatest possible length, at which the error of a step accumulates most.
TEST_P(ThinLines, AreTheDefinedVoxelsAtTheGreatestLength) {
  std::mt19937_64 random(5);
  for (int i = 0; i < 300; ++i) {
    Line line;
    line.sampling = GetParam();
    const int major = static_cast<int>(random() % 3);
    for (int a = 0; a < 3; ++a) {
      std::uniform_int_distribution<int64_t> any(-4300 * 256, 4300 * 256);
      line.s[a] = a == major ? -4340 * 256 : any(random);
      line.e[a] =
          a == major ? 4350 * 256 + 255 : line.s[a] + static_cast<int64_t>(random() % 2000) - 1000;
    }
    if (random() % 2 == 0) std::swap(line.s, line.e);
    ASSERT_LE(LineSteps(line), kMaxThinSteps);
    ASSERT_GT(LineSteps(line), kMaxThinSteps - 20);
    Check(line);
  }
}

INSTANTIATE_TEST_SUITE_P(Sampling, ThinLines,
                         ::testing::Values(LineSampling::kThin, LineSampling::kEuclidean));

TEST(AreThinTest, KnowsItsBounds) {
  const double low[3] = {-10, 0, 0}, near[3] = {4000, 4000, 4000}, far[3] = {8000, 8000, 0},
               out[3] = {16384, 0, 0};
  EXPECT_TRUE(AreThin(low, near));
  EXPECT_FALSE(AreThin(low, far));
  EXPECT_FALSE(AreThin(low, out));
  const double nan[3] = {__builtin_nan(""), 0, 0};
  EXPECT_FALSE(AreThin(low, nan));
  EXPECT_FALSE(AreThin(nan, low));
}

}  // namespace
}  // namespace voxeld::gpu
