// Tests the bytes of a change, parsed by hand according to docs/protocols/viewer.md.
#include "daemon/viewer/volume_message.h"

#include <gtest/gtest.h>

#include <cstring>

#include "display/geometry/footprint.h"

namespace voxeld::daemon::viewer {
namespace {

template <typename T>
T Read(const std::string& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

display::Geometry ThreePlanes() {
  display::PlanarStack stack;
  stack.width_px = 2, stack.height_px = 1;
  stack.positions_mm = {0, 1, 2};
  display::Geometry geometry{.shape = stack};
  geometry.grid = display::DefaultGrid(geometry);
  return geometry;
}

display::Picture PictureOf(std::initializer_list<int> bytes) {
  auto picture = std::make_shared<std::vector<std::byte>>();
  for (const int byte : bytes) picture->push_back(static_cast<std::byte>(byte));
  return picture;
}

TEST(VolumeMessage, IsAsItIsDocumented) {
  PixelPlaces places(ThreePlanes());
  VolumeFeed::Change change;
  change.volume.volume = 0x1122334455;
  change.volume.layout = {.slices = 3, .width = 2, .height = 1};
  change.volume.pictures = {PictureOf({9, 8, 7, 0, 0, 0}), PictureOf({0, 0, 0, 0, 0, 0}),
                            PictureOf({1, 2, 3, 4, 5, 6})};
  change.slices = {0, 2};
  const std::string bytes = VolumeMessage(513, change, places);
  ASSERT_EQ(bytes.size(), 24u + 2 * 8 + 3 * 9);
  EXPECT_EQ(Read<uint8_t>(bytes, 0), 1);
  EXPECT_EQ(Read<uint8_t>(bytes, 1), 0) << "not whole";
  EXPECT_EQ(Read<uint16_t>(bytes, 2), 513);
  EXPECT_EQ(Read<uint32_t>(bytes, 4), 2u);
  EXPECT_EQ(Read<uint32_t>(bytes, 8), 3u);
  EXPECT_EQ(Read<uint64_t>(bytes, 16), 0x1122334455u);
  EXPECT_EQ(Read<uint32_t>(bytes, 24), 0u);
  EXPECT_EQ(Read<uint32_t>(bytes, 28), 1u);
  EXPECT_EQ(Read<uint32_t>(bytes, 32), 2u);
  EXPECT_EQ(Read<uint32_t>(bytes, 36), 2u);
  // x of the three, then z: two adjacent pixels, in the first and in the last plane.
  EXPECT_EQ(Read<uint16_t>(bytes, 40), 0);
  EXPECT_EQ(Read<uint16_t>(bytes, 42), 0);
  EXPECT_EQ(Read<uint16_t>(bytes, 44), kPlaceSteps);
  EXPECT_EQ(Read<uint16_t>(bytes, 52), 0);
  EXPECT_EQ(Read<uint16_t>(bytes, 54), kPlaceSteps);
  EXPECT_EQ(Read<uint16_t>(bytes, 56), kPlaceSteps);
  EXPECT_EQ(bytes.substr(58), std::string("\x09\x08\x07\x01\x02\x03\x04\x05\x06"));
}

TEST(VolumeMessage, DarkPixelsAreASample) {
  PixelPlaces places(ThreePlanes());
  const std::string bytes = DarkMessage(1, places);
  EXPECT_EQ(Read<uint8_t>(bytes, 0), 2);
  EXPECT_EQ(Read<uint32_t>(bytes, 8), 6u) << "all, where there are few";
  EXPECT_EQ(bytes.size(), 24u + 54);
}

}  // namespace
}  // namespace voxeld::daemon::viewer
