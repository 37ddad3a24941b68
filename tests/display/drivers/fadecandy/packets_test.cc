#include "display/drivers/fadecandy/packets.h"

#include <vector>

#include "gtest/gtest.h"

namespace voxeld::display::fadecandy {
namespace {

int At(const TransferBytes& bytes, size_t packet, size_t offset) {
  return std::to_integer<int>(bytes[packet * 64 + offset]);
}

std::vector<std::byte> Counting() {
  std::vector<std::byte> rgb(1536);
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<std::byte>(i / 3 * 7 + i % 3);
  return rgb;
}

TEST(FadecandyPackets, AFrameIsTwentyFive) {
  const std::vector<std::byte> rgb = Counting();
  TransferBytes out;
  AppendFrame(out, rgb, 0, 25);
  ASSERT_EQ(out.size(), 1600u);
  for (size_t i = 0; i < 24; ++i) EXPECT_EQ(At(out, i, 0), static_cast<int>(i));
  EXPECT_EQ(At(out, 24, 0), 0x38);
  // Pixel 0, and pixel 20, the last of packet 0.
  EXPECT_EQ(At(out, 0, 1), 0);
  EXPECT_EQ(At(out, 0, 3), 2);
  EXPECT_EQ(At(out, 0, 61), 20 * 7);
  EXPECT_EQ(At(out, 0, 63), 20 * 7 + 2);
  // Pixel 21 begins packet 1, pixel 504 packet 24; pixel 511 ends at byte 24 of it.
  EXPECT_EQ(At(out, 1, 1), 21 * 7);
  EXPECT_EQ(At(out, 24, 1), 504 * 7 & 0xFF);
  EXPECT_EQ(At(out, 24, 24), (511 * 7 + 2) & 0xFF);
  for (size_t i = 25; i < 64; ++i) EXPECT_EQ(At(out, 24, i), 0);
}

TEST(FadecandyPackets, AFrameInTwoPartsIsTheSame) {
  const std::vector<std::byte> rgb = Counting();
  TransferBytes whole, parts;
  AppendFrame(whole, rgb, 0, kFramePackets);
  AppendFrame(parts, rgb, 0, kLastPacket);
  EXPECT_EQ(parts.size(), 24 * 64u);
  AppendFrame(parts, rgb, kLastPacket, kFramePackets);
  EXPECT_TRUE(std::equal(whole.begin(), whole.end(), parts.begin(), parts.end()));
}

TEST(FadecandyPackets, ATableIsTwentyFive) {
  Lut lut;
  for (size_t i = 0; i < lut.size(); ++i) lut[i] = static_cast<uint16_t>(0xA000 + i);
  TransferBytes out;
  AppendLut(out, lut);
  ASSERT_EQ(out.size(), 1600u);
  for (size_t i = 0; i < 24; ++i) EXPECT_EQ(At(out, i, 0), 0x40 + static_cast<int>(i));
  EXPECT_EQ(At(out, 24, 0), 0x78);
  for (size_t i = 0; i < 25; ++i) EXPECT_EQ(At(out, i, 1), 0);
  EXPECT_EQ(At(out, 0, 2), 0x00);
  EXPECT_EQ(At(out, 0, 3), 0xA0);
  // Entry 31 is the first of packet 1; 257, the first of green, is number 9 of packet 8.
  EXPECT_EQ(At(out, 1, 2), 31);
  EXPECT_EQ(At(out, 8, 2 + 2 * 9), 257 & 0xFF);
  EXPECT_EQ(At(out, 8, 3 + 2 * 9), 0xA1);
  // Entry 770, the last of blue, is number 26 of packet 24.
  EXPECT_EQ(At(out, 24, 2 + 2 * 26), 770 & 0xFF);
  EXPECT_EQ(At(out, 24, 3 + 2 * 26), 0xA3);
  for (size_t i = 56; i < 64; ++i) EXPECT_EQ(At(out, 24, i), 0);
}

TEST(FadecandyPackets, Configuration) {
  TransferBytes out;
  AppendConfig(out, kNoInterpolation | kManualLed);
  ASSERT_EQ(out.size(), 64u);
  EXPECT_EQ(At(out, 0, 0), 0x80);
  EXPECT_EQ(At(out, 0, 1), 6);
}

}  // namespace
}  // namespace voxeld::display::fadecandy
