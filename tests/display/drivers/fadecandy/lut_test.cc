#include "display/drivers/fadecandy/lut.h"

#include "gtest/gtest.h"

namespace voxeld::display::fadecandy {
namespace {

constexpr size_t kGreen = kLutEntries, kBlue = 2 * kLutEntries;

// Entry 64 is a little more than a quarter: (1/4)^2.5 = 1/32, of 65535. Entry 128: (1/2)^2.5.
TEST(FadecandyLut, Defaults) {
  const Lut lut = MakeLut({}, 1);
  for (const size_t channel : {size_t{0}, kGreen, kBlue}) {
    EXPECT_EQ(lut[channel + 0], 0);
    EXPECT_EQ(lut[channel + 1], 0);
    EXPECT_EQ(lut[channel + 64], 2048);
    EXPECT_EQ(lut[channel + 128], 11586);
    EXPECT_EQ(lut[channel + 255], 64899);
    EXPECT_EQ(lut[channel + 256], 65535);  // 65537.5, clamped
  }
}

TEST(FadecandyLut, WhitePointScalesWhatComesIn) {
  const Lut lut = MakeLut({.white = {1, 0.5, 0}}, 1);
  EXPECT_EQ(lut[256], 65535);
  EXPECT_EQ(lut[kGreen + 128], 2048);
  EXPECT_EQ(lut[kGreen + 256], 11586);
  for (size_t i = 0; i < kLutEntries; ++i) EXPECT_EQ(lut[kBlue + i], 0);
}

// Half of the input up to a quarter of the light, that is up to 32767.5 of 65535.
TEST(FadecandyLut, LinearBelowTheCutoff) {
  const Lut lut = MakeLut({.slope = 0.5, .cutoff = 0.25}, 1);
  EXPECT_EQ(lut[1], 128);
  EXPECT_EQ(lut[32], 4096);
  EXPECT_EQ(lut[127], 16256);
  // 0.25 + ((0.50000763 − 0.125) / 0.75)^2.5 · 0.75
  EXPECT_EQ(lut[128], 25073);
  EXPECT_EQ(lut[200], 51586);
  EXPECT_EQ(lut[256], 65535);
}

TEST(FadecandyLut, LinearAllTheWay) {
  const Lut lut = MakeLut({.gamma = 1}, 1);
  for (size_t i = 0; i < 256; ++i) EXPECT_EQ(lut[i], i * 256);
  EXPECT_EQ(lut[256], 65535);
}

TEST(FadecandyLut, BrightnessScalesLight) {
  const Lut lut = MakeLut({}, 0.5);
  EXPECT_EQ(lut[64], 1024);
  EXPECT_EQ(lut[128], 5793);
  EXPECT_EQ(lut[255], 32450);
  EXPECT_EQ(MakeLut({}, 0), Lut{});
}

// A slope above 1 ends the linear part where the power's base is still below 0.
TEST(FadecandyLut, IsANumberForEverySlope) {
  const Lut lut = MakeLut({.slope = 4, .cutoff = 0.5}, 1);
  EXPECT_EQ(lut[31], 31 * 4 * 256);
  EXPECT_EQ(lut[64], 32768);  // the cutoff itself: the power's base is 0
  EXPECT_EQ(MakeLut({.white = {8, 1, 1}}, 1)[128], 65535);
}

}  // namespace
}  // namespace voxeld::display::fadecandy
