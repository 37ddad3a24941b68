#include "gpu/texture_levels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "gpu/primitives/texture.h"

namespace voxeld::gpu {
namespace {

using ::testing::ElementsAre;

std::vector<uint32_t> LevelsOf(uint32_t width, uint32_t height, std::vector<uint32_t> first) {
  const size_t begin = first.size();
  first.resize(TexelCount(width, height), 0xDEADBEEF);
  FillLevels(width, height, first);
  return {first.begin() + static_cast<std::ptrdiff_t>(begin), first.end()};
}

TEST(TextureLevels, AreCounted) {
  EXPECT_EQ(TexelCount(1, 1), 1u);
  EXPECT_EQ(TexelCount(4, 4), 16u + 4 + 1);
  EXPECT_EQ(TexelCount(5, 1), 5u + 2 + 1);
  EXPECT_EQ(TexelCount(2, 9), 18u + 4 + 2 + 1);
  EXPECT_EQ(TexelCount(8192, 8192), (uint64_t{4} * 8192 * 8192 - 1) / 3);
}

TEST(TextureLevels, AreMeansWithHalvesRoundedUp) {
  EXPECT_THAT(LevelsOf(2, 2, {0xFF0000, 0x00FF00, 0x0000FF, 0xFFFFFF}), ElementsAre(0x808080));
  EXPECT_THAT(LevelsOf(2, 2, {0x010000, 0x000100, 0x000001, 0x010101}), ElementsAre(0x010101));
  EXPECT_THAT(LevelsOf(2, 2, {0x010000, 0x000100, 0x000001, 0}), ElementsAre(0));
  EXPECT_THAT(LevelsOf(2, 2, {0xFFFFFF, 0xFFFFFF, 0xFFFFFF, 0xFFFFFF}), ElementsAre(0xFFFFFF));
}

TEST(TextureLevels, OfOneRowOrColumnAreMeansOfTwo) {
  EXPECT_THAT(LevelsOf(4, 1, {2, 4, 8, 16}), ElementsAre(3, 12, 8));
  EXPECT_THAT(LevelsOf(1, 4, {2, 4, 8, 16}), ElementsAre(3, 12, 8));
}

// The remainder of an odd side is not used.
TEST(TextureLevels, OfOddSidesAreOfWholePairs) {
  EXPECT_THAT(LevelsOf(5, 2, {1, 1, 2, 2, 99, 3, 3, 4, 4, 99}), ElementsAre(2, 3, 3));
  EXPECT_THAT(LevelsOf(1, 1, {7}), ElementsAre());
}

}  // namespace
}  // namespace voxeld::gpu
