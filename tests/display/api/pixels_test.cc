#include "display/api/pixels.h"

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
  const FrameLayout layout{
      .slices = 1, .width = 9, .height = 2, .format = PixelFormat::kBitPlanes3};
  const std::vector<uint8_t> light =
      Light(layout, {0x80, 0x80, 0, 0, /*G*/ 0, 0, 0x40, 0, /*B*/ 0, 0, 0, 0x80});
  std::vector<uint8_t> expected(9 * 2 * 3);
  expected[0] = 255;                // R of (0, 0)
  expected[8 * 3] = 255;            // R of (8, 0)
  expected[(9 + 1) * 3 + 1] = 255;  // G of (1, 1)
  expected[(9 + 8) * 3 + 2] = 255;  // B of (8, 1)
  EXPECT_EQ(light, expected);
}

TEST(Pixels, SubFramesAreAveraged) {
  const FrameLayout layout{.slices = 1, .width = 1, .height = 1, .sub_frames = 2};
  EXPECT_EQ(Light(layout, {0, 10, 255, 255, 11, 255}), (std::vector<uint8_t>{128, 11, 255}));
}

}  // namespace
}  // namespace voxeld::display
