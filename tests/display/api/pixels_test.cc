#include "display/api/pixels.h"

#include <random>
#include <span>
#include <vector>

#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

std::vector<uint8_t> Light(FrameLayout layout, std::vector<int> bytes) {
  SliceFrame frame{.volume = 1, .layout = layout};
  for (const int b : bytes) frame.bytes.push_back(static_cast<std::byte>(b));
  EXPECT_EQ(frame.bytes.size(), layout.bytes());
  return FrameToRgb(frame);
}

TEST(Pixels, Rgb888IsItself) {
  EXPECT_EQ(Light({.slices = 2, .width = 1, .height = 1}, {1, 2, 3, 4, 5, 6}),
            (std::vector<uint8_t>{1, 2, 3, 4, 5, 6}));
}

TEST(Pixels, Rgb332SpreadsOverTheRange) {
  const FrameLayout layout{.slices = 1, .width = 4, .height = 1, .format = PixelFormat::kRgb332};
  EXPECT_EQ(Light(layout, {0xFF, 0x00, 0b001'011'10, 0b100'001'01}),
            (std::vector<uint8_t>{255, 255, 255, 0, 0, 0, 36, 109, 170, 146, 36, 85}));
}

TEST(Pixels, BitPlanesAreRowsOfBitsFromTheLeft) {
  // 9 pixels wide: two bytes a row; two rows; planes R, G, B.
  const FrameLayout layout{.slices = 1, .width = 9, .height = 2, .format = PixelFormat::kBitPlanes};
  const std::vector<uint8_t> light =
      Light(layout, {0x80, 0x80, 0, 0, /*G*/ 0, 0, 0x40, 0, /*B*/ 0, 0, 0, 0x80});
  std::vector<uint8_t> expected(9 * 2 * 3);
  expected[0] = 255;                // R of (0, 0)
  expected[8 * 3] = 255;            // R of (8, 0)
  expected[(9 + 1) * 3 + 1] = 255;  // G of (1, 1)
  expected[(9 + 8) * 3 + 2] = 255;  // B of (8, 1)
  EXPECT_EQ(light, expected);
}

TEST(Pixels, BytesOfFewBitsAreLevels) {
  const FrameLayout layout{.slices = 1, .width = 1, .height = 1, .bits = 4};
  EXPECT_EQ(Light(layout, {0, 5, 15}), (std::vector<uint8_t>{0, 85, 255}));
}

TEST(Pixels, BitPlanesOfSeveralBitsBeginWithTheHighest) {
  const FrameLayout layout{
      .slices = 1, .width = 8, .height = 1, .format = PixelFormat::kBitPlanes, .bits = 2};
  const std::vector<uint8_t> light = Light(layout, {0x80, 0, 0x01, /*low*/ 0, 0x80, 0x01});
  EXPECT_EQ(light[0], 170);          // R of pixel 0: 2 of 3
  EXPECT_EQ(light[1], 85);           // G
  EXPECT_EQ(light[7 * 3 + 2], 255);  // B of pixel 7
}

TEST(Pixels, Hub75HasTwoRowsInAByte) {
  const FrameLayout layout{.slices = 1, .width = 1, .height = 2, .format = PixelFormat::kHub75};
  EXPECT_EQ(Light(layout, {0b010'101}), (std::vector<uint8_t>{255, 0, 255, 0, 255, 0}));
}

TEST(Pixels, Planes24AreAveragedOverTheirParts) {
  const FrameLayout layout{.slices = 1, .width = 1, .height = 1, .format = PixelFormat::kPlanes24};
  // Red in all eight parts, green in parts 0 and 2, blue in no part: bits 0, 3, 6, …; 1 and 7.
  EXPECT_EQ(Light(layout, {0b1100'1011, 0b1001'0010, 0b0010'0100}),
            (std::vector<uint8_t>{255, 64, 0}));
}

TEST(Pixels, SubFramesAreAveraged) {
  const FrameLayout layout{.slices = 1, .width = 1, .height = 1, .sub_frames = 2};
  EXPECT_EQ(Light(layout, {0, 10, 255, 255, 11, 255}), (std::vector<uint8_t>{128, 11, 255}));
}

// Compared with the light of every pixel, which another function computes.
TEST(Pixels, LightIsTheMeanOfAllLevels) {
  std::mt19937 random(5);
  for (const PixelFormat format :
       {PixelFormat::kRgb888, PixelFormat::kRgb332, PixelFormat::kBitPlanes, PixelFormat::kHub75,
        PixelFormat::kPlanes24}) {
    for (const int32_t bits : {0, 1, 3, 8}) {
      if (bits != 0 && (format == PixelFormat::kRgb332 || format == PixelFormat::kPlanes24))
        continue;
      const FrameLayout layout{
          .slices = 1, .width = 13, .height = 6, .sub_frames = 1, .format = format, .bits = bits};
      std::vector<std::byte> picture(layout.bytes_per_slice());
      EXPECT_EQ(LightOf(layout, picture), 0);
      const int most = (1 << layout.bits_per_channel()) - 1;
      for (std::byte& byte : picture) {
        const auto value = static_cast<int>(random());
        byte = static_cast<std::byte>(format == PixelFormat::kRgb888  ? value & most
                                      : format == PixelFormat::kHub75 ? value & 0x3F
                                                                      : value);
      }
      if (format == PixelFormat::kBitPlanes) {  // no pixels lie beyond a row's end
        for (size_t end = 1; end < picture.size(); end += 2) picture[end] &= std::byte{0xF8};
      }
      std::vector<uint8_t> rgb(13 * 6 * 3);
      const std::span<const std::byte> pictures[] = {picture};
      SliceToRgb(layout, pictures, rgb);
      double sum = 0;
      for (const uint8_t light : rgb) sum += light;
      EXPECT_NEAR(LightOf(layout, picture), sum / 255 / static_cast<double>(rgb.size()), 0.002)
          << static_cast<int>(format) << ", " << bits;
    }
  }
}

}  // namespace
}  // namespace voxeld::display
