#include "gpu/word.h"

#include <gtest/gtest.h>

namespace voxeld::gpu {
namespace {

TEST(Word, ColoursInterleaveGreenRedBlueFromTheTop) {
  EXPECT_EQ(Interleave(0x008000), 1u << 23);
  EXPECT_EQ(Interleave(0x800000), 1u << 22);
  EXPECT_EQ(Interleave(0x000080), 1u << 21);
  EXPECT_EQ(Interleave(0x000100), 1u << 2);
  EXPECT_EQ(Interleave(0x010000), 1u << 1);
  EXPECT_EQ(Interleave(0x000001), 1u);
  EXPECT_EQ(Interleave(0xFFFFFF), kColorMask);
}

TEST(Word, InterleavingGoesBackForEveryChannelValue) {
  for (uint32_t c = 0; c < 256; ++c) {
    const uint32_t rgb = c << 16 | (255 - c) << 8 | (c ^ 0x5A);
    EXPECT_EQ(Deinterleave(Interleave(rgb)), rgb);
  }
}

TEST(Word, PriorityThenEraseThenColour) {
  const uint32_t black = MakeWord(0, false, 0x000000);
  EXPECT_EQ(black, 1u << 25);
  EXPECT_TRUE(IsCovered(black));  // black covers
  EXPECT_FALSE(IsCovered(0));
  const uint32_t white = MakeWord(0, false, 0xFFFFFF), erase = MakeWord(0, true, 0xFFFFFF);
  EXPECT_GT(erase, white);
  EXPECT_EQ(erase & kColorMask, 0u);
  EXPECT_FALSE(IsCovered(erase));
  EXPECT_GT(MakeWord(1, false, 0), erase);
  EXPECT_GT(MakeWord(126, false, 0), MakeWord(125, true, 0));
  EXPECT_GT(MakeWord(5, false, 0x008000), MakeWord(5, false, 0xFF7FFF));  // green weighs most
}

}  // namespace
}  // namespace voxeld::gpu
