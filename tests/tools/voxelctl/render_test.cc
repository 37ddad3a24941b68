// Tests pictures: what is right, up and near in the display is so in the picture.
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <variant>

#include "display/geometry/footprint.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/render/png_file.h"
#include "tools/voxelctl/render/render_volume.h"

namespace voxeld::voxelctl {
namespace {

constexpr ViewAngles kFront = {0, 0};

Volume Empty(display::Geometry geometry, int width, int height) {
  Volume volume;
  geometry.grid = display::DefaultGrid(geometry);
  volume.geometry = geometry;
  volume.slices = display::SliceCount(geometry);
  volume.width = width;
  volume.height = height;
  volume.rgb.resize(volume.slice_bytes() * static_cast<size_t>(volume.slices));
  return volume;
}

// 32 horizontal slices of 32×32 pixels, 1 mm apart in all directions.
Volume Stack() {
  display::PlanarStack stack;
  stack.width_px = stack.height_px = 32;
  for (int i = 0; i < 32; ++i) stack.positions_mm.push_back(i - 15.5);
  return Empty({.shape = stack, .grid = {}}, 32, 32);
}

Volume Spinner() {
  display::Rotor rotor;
  rotor.slices_per_turn = 90;
  rotor.width_px = rotor.height_px = 32;
  rotor.panels.push_back({});
  return Empty({.shape = rotor, .grid = {}}, 32, 32);
}

// The same lights as the stack's, 1024 a slice; every fifth is missing.
Volume Lights() {
  display::Lattice lattice;
  lattice.width_px = 32 * 32;
  for (int n = 0; n < 32 * 32 * 32; ++n) {
    lattice.points_mm.push_back(display::Vec3{n % 32 - 15.5, n / 32 % 32 - 15.5, n / 1024 - 15.5});
    if (n % 5 == 4) lattice.points_mm.back().reset();
  }
  return Empty({.shape = lattice, .grid = {}}, 1024, 1);
}

uint8_t* PixelOf(Volume* volume, int slice, int u, int v) {
  return volume->rgb.data() + (volume->pixel(slice, u, v) - volume->rgb.data());
}

// Lights every slice pixel within `radius` mm of a place.
void Light(Volume* volume, display::Vec3 at, double radius, uint8_t r, uint8_t g, uint8_t b) {
  int lit = 0;
  for (int s = 0; s < volume->slices; ++s) {
    for (int u = 0; u < volume->width; ++u) {
      for (int v = 0; v < volume->height; ++v) {
        const display::Vec3 p = display::PixelPosition(volume->geometry, s, u, v);
        if (!(std::hypot(p.x - at.x, p.y - at.y, p.z - at.z) <= radius)) continue;
        uint8_t* pixel = PixelOf(volume, s, u, v);
        pixel[0] = r, pixel[1] = g, pixel[2] = b;
        ++lit;
      }
    }
  }
  ASSERT_GT(lit, 0);
}

struct Spot {
  double x = 0, y = 0;  // the middle of its light
  int brightest = 0;
  double area = 0;  // the screen pixels above half of the brightest
};

// Finds the spot of one channel, ignoring the parts of it in the outline and the axes.
Spot Find(const Image& image, int channel) {
  Spot spot;
  double sum = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const uint8_t* p = image.rgb.data() + (static_cast<size_t>(y) * image.width + x) * 3;
      const int other = std::max(p[(channel + 1) % 3], p[(channel + 2) % 3]);
      const bool corner = x < image.width / 5 && y > image.height * 4 / 5;
      const int value = p[channel];
      if (corner || value < 60 || value < 2 * other) continue;
      spot.brightest = std::max(spot.brightest, value);
      sum += value;
      spot.x += value * (x + 0.5);
      spot.y += value * (y + 0.5);
      spot.area += 1;
    }
  }
  if (sum > 0) {
    spot.x /= sum;
    spot.y /= sum;
  }
  return spot;
}

enum class Kind { kStack, kRotor, kLattice };

class RenderTest : public testing::TestWithParam<Kind> {
 protected:
  Volume NewVolume() const {
    return GetParam() == Kind::kStack ? Stack() : GetParam() == Kind::kRotor ? Spinner() : Lights();
  }
  Image Draw(const Volume& volume, ViewAngles angles) const {
    EXPECT_THAT(CheckVolume(volume), IsOk());
    return RenderVolume(volume, {.width = 320, .height = 320, .angles = angles});
  }
};

// Displays whose pixels are not points with gaps in between.
class SurfaceTest : public RenderTest {};

TEST_P(RenderTest, RightIsRightAndUpIsUp) {
  Volume volume = NewVolume();
  Light(&volume, {9, 0, 0}, 1.6, 255, 0, 0);
  Light(&volume, {0, 0, 9}, 1.6, 0, 255, 0);
  const Image image = Draw(volume, kFront);
  const Spot right = Find(image, 0), up = Find(image, 1);
  ASSERT_GT(right.area, 20);
  ASSERT_GT(up.area, 20);
  EXPECT_GT(right.x, 190);
  EXPECT_NEAR(right.y, 160, 6);
  EXPECT_LT(up.y, 130);
  EXPECT_NEAR(up.x, 160, 6);
}

TEST_P(RenderTest, WhatIsOnTheAxisStaysWhereItIsAsTheViewerWalksAround) {
  Volume volume = NewVolume();
  Light(&volume, {0, 0, 9}, 1.6, 0, 255, 0);
  const auto spot_at = [&](double azimuth) {
    return Find(RenderVolume(
                    volume, {.width = 320, .height = 320, .angles = {azimuth, 20}, .around = true}),
                1);
  };
  const Spot first = spot_at(0);
  EXPECT_NEAR(first.x, 160, 2);
  for (const double azimuth : {30.0, 45.0, 77.0, 200.0}) {
    const Spot spot = spot_at(azimuth);
    EXPECT_NEAR(spot.x, first.x, 2) << azimuth;
    EXPECT_NEAR(spot.y, first.y, 2) << azimuth;
    EXPECT_NEAR(spot.area, first.area, 0.2 * first.area) << azimuth;
  }
}

TEST_P(RenderTest, NearerIsBrighterAndLarger) {
  Volume volume = NewVolume();
  Light(&volume, {-6, -9, 0}, 1.6, 255, 0, 0);
  Light(&volume, {6, 9, 0}, 1.6, 0, 255, 0);
  const Image image = Draw(volume, kFront);
  const Spot near = Find(image, 0), far = Find(image, 1);
  ASSERT_GT(far.area, 20);
  EXPECT_GT(near.brightest, far.brightest + 15);
  EXPECT_GT(near.area, far.area * 1.2);
}

// Near the axis many pixels show one place: if each has less light because of that, the place looks
// as bright as one at the rim. Seen from above, so that both are equally near.
TEST(Render, PixelsThatCrowdAreSeenTogether) {
  for (const bool even : {false, true}) {
    Volume volume = Spinner();
    Light(&volume, {3, 0, 8}, 1.6, 240, 0, 0);
    Light(&volume, {0, -13, 8}, 1.6, 0, 240, 0);
    for (int s = 0; even && s < volume.slices; ++s) {
      for (int u = 0; u < volume.width; ++u) {
        for (int v = 0; v < volume.height; ++v) {
          uint8_t* pixel = PixelOf(&volume, s, u, v);
          const double share = std::abs(u - 15.5) / 15.5;
          for (int c = 0; c < 3; ++c) pixel[c] = static_cast<uint8_t>(pixel[c] * share);
        }
      }
    }
    const Image image = RenderVolume(volume, {.width = 320, .height = 320, .angles = {0, 89}});
    const Spot inner = Find(image, 0), outer = Find(image, 1);
    ASSERT_GT(inner.area, 20);
    ASSERT_GT(outer.area, 20);
    EXPECT_NEAR(inner.brightest, outer.brightest, 30) << "even: " << even;
  }
}

TEST_P(RenderTest, WalkingRoundTheDisplay) {
  Volume volume = NewVolume();
  Light(&volume, {9, 0, 0}, 1.6, 255, 0, 0);
  // From the right side, what is right is near and in the middle; from behind it is left.
  EXPECT_NEAR(Find(Draw(volume, {90, 0}), 0).x, 160, 6);
  EXPECT_LT(Find(Draw(volume, {180, 0}), 0).x, 130);
  const Spot side = Find(Draw(volume, {90, 0}), 0), front = Find(Draw(volume, kFront), 0);
  EXPECT_GT(side.brightest, front.brightest);
}

TEST_P(RenderTest, FromAboveTheFrontIsLow) {
  Volume volume = NewVolume();
  Light(&volume, {0, -9, 0}, 1.6, 255, 0, 0);
  EXPECT_GT(Find(Draw(volume, {0, 40}), 0).y, 190);
}

TEST_P(SurfaceTest, WhatIsInFrontCoversWhatIsBehind) {
  Volume volume = NewVolume();
  Light(&volume, {0, -9, 0}, 3, 255, 0, 0);
  Light(&volume, {0, 9, 0}, 2, 0, 255, 0);
  const Image image = Draw(volume, kFront);
  const uint8_t* middle = image.rgb.data() + (static_cast<size_t>(160) * 320 + 160) * 3;
  EXPECT_GT(middle[0], 150);
  EXPECT_LT(middle[1], middle[0] / 2);
}

TEST_P(SurfaceTest, SurfacesClose) {
  Volume volume = NewVolume();
  // A wall across the middle: without dark gaps between its pixels.
  for (int s = 0; s < volume.slices; ++s) {
    for (int u = 0; u < volume.width; ++u) {
      for (int v = 0; v < volume.height; ++v) {
        const display::Vec3 p = display::PixelPosition(volume.geometry, s, u, v);
        if (std::abs(p.y) > 0.8 || std::abs(p.x) > 10 || std::abs(p.z) > 10) continue;
        uint8_t* pixel = PixelOf(&volume, s, u, v);
        pixel[0] = pixel[1] = pixel[2] = 200;
      }
    }
  }
  const Image image = Draw(volume, kFront);
  int darkest = 255;
  for (int y = 110; y < 210; ++y) {
    for (int x = 110; x < 210; ++x)
      darkest = std::min<int>(darkest, image.rgb[(static_cast<size_t>(y) * 320 + x) * 3]);
  }
  EXPECT_GT(darkest, 90);
}

TEST_P(RenderTest, ADarkVolumeShowsItsOutline) {
  const Image image = Draw(NewVolume(), {24, 20});
  int lit = 0;
  for (size_t i = 0; i < image.rgb.size(); i += 3) lit += image.rgb[i + 2] > 45 ? 1 : 0;
  EXPECT_GT(lit, 500);
  EXPECT_LT(lit, 320 * 320 / 10);
}

std::string NameOf(const testing::TestParamInfo<Kind>& info) {
  return info.param == Kind::kStack ? "stack" : info.param == Kind::kRotor ? "rotor" : "lattice";
}
INSTANTIATE_TEST_SUITE_P(Displays, RenderTest,
                         testing::Values(Kind::kStack, Kind::kRotor, Kind::kLattice), NameOf);
INSTANTIATE_TEST_SUITE_P(Displays, SurfaceTest, testing::Values(Kind::kStack, Kind::kRotor),
                         NameOf);

TEST(RenderLattice, APixelWithoutALightIsNotDrawn) {
  Volume volume = Lights();
  uint8_t* absent = PixelOf(&volume, 16, 16 * 32 + 14, 0);
  const auto& points = std::get<display::Lattice>(volume.geometry.shape).points_mm;
  while (points[static_cast<size_t>((absent - volume.rgb.data()) / 3)].has_value()) absent += 3;
  const RenderOptions options{.width = 320, .height = 320, .angles = kFront};
  const Image dark = RenderVolume(volume, options);
  absent[0] = absent[1] = absent[2] = 255;
  EXPECT_EQ(RenderVolume(volume, options).rgb, dark.rgb);
  absent[3] = absent[4] = absent[5] = 255;  // its neighbour exists
  EXPECT_NE(RenderVolume(volume, options).rgb, dark.rgb);
}

TEST(CheckVolume, RefusesWhatDoesNotFit) {
  Volume volume = Stack();
  volume.rgb.pop_back();
  EXPECT_THAT(CheckVolume(volume), Fails(Words{"98303 bytes", "98304"}));
  volume = Stack();
  volume.slices = 31;
  EXPECT_THAT(CheckVolume(volume), Fails(Words{"31 slices", "32 of 32x32"}));
  volume = Stack();
  std::get<display::PlanarStack>(volume.geometry.shape).pitch_u_mm = std::nan("");
  EXPECT_FALSE(CheckVolume(volume).ok());
}

TEST(ContactSheet, ShowsEverySliceUpright) {
  Volume volume = Stack();
  for (int s = 0; s < 32; ++s) {
    uint8_t* pixel = PixelOf(&volume, s, 1, 30);
    pixel[0] = 255;
    pixel[1] = static_cast<uint8_t>(s + 1);
  }
  const Image sheet = ContactSheet(volume);
  ASSERT_EQ(sheet.rgb.size(), static_cast<size_t>(sheet.width) * sheet.height * 3);
  const int columns = (sheet.width - 2) / 34;
  for (int s = 0; s < 32; ++s) {
    const int x = 2 + s % columns * 34 + 1, y = 2 + s / columns * 34 + (31 - 30);
    const uint8_t* p = sheet.rgb.data() + (static_cast<size_t>(y) * sheet.width + x) * 3;
    EXPECT_EQ(p[0], 255) << s;
    EXPECT_EQ(p[1], s + 1);
  }
}

TEST(ContactSheet, FoldsALatticesRowsIntoSquares) {
  // 6 slices of 10 lights: rows of 4, 4 and 2, each light 8·8 pixels.
  display::Lattice lattice;
  lattice.width_px = 10;
  for (int n = 0; n < 60; ++n) lattice.points_mm.push_back(display::Vec3{n * 1.0, 0, 0});
  Volume volume = Empty({.shape = lattice, .grid = {}}, 10, 1);
  ASSERT_THAT(CheckVolume(volume), IsOk());
  for (int s = 0; s < 6; ++s) PixelOf(&volume, s, 6, 0)[1] = static_cast<uint8_t>(100 + s);
  const Image sheet = ContactSheet(volume);
  ASSERT_EQ(sheet.rgb.size(), static_cast<size_t>(sheet.width) * sheet.height * 3);
  const int columns = (sheet.width - 2) / 34;
  ASSERT_EQ(sheet.width, 2 + columns * 34);
  for (int s = 0; s < 6; ++s) {
    int lit = 0;
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 32; ++x) {
        const int left = 2 + s % columns * 34 + x, top = 2 + s / columns * 26 + y;
        const uint8_t* p = sheet.rgb.data() + (static_cast<size_t>(top) * sheet.width + left) * 3;
        // Light 6 is the third of the middle row.
        const bool of_light = x / 8 == 2 && y / 8 == 1;
        EXPECT_EQ(p[1], of_light ? 100 + s : 0) << s << ": " << x << ", " << y;
        lit += p[1] > 0 ? 1 : 0;
      }
    }
    EXPECT_EQ(lit, 64);
  }
}

TEST(ContactSheet, OfALargeLatticeStaysInBounds) {
  display::Lattice lattice;
  lattice.width_px = 1;
  for (int n = 0; n < 16384; ++n) lattice.points_mm.push_back(display::Vec3{n * 1.0, 0, 0});
  for (const int width : {1, 16384}) {
    lattice.width_px = width;
    Volume volume = Empty({.shape = lattice, .grid = {}}, width, 1);
    ASSERT_THAT(CheckVolume(volume), IsOk());
    const Image sheet = ContactSheet(volume);
    EXPECT_LE(sheet.width, 2048);
    EXPECT_LE(sheet.height, 2048);
    EXPECT_GE(sheet.width, 512);
    EXPECT_GE(sheet.height, 512);
  }
}

TEST(ContactSheet, OfManyLargeSlicesIsShrunk) {
  display::PlanarStack stack;
  stack.width_px = stack.height_px = 300;
  for (int i = 0; i < 1500; ++i) stack.positions_mm.push_back(i);
  Volume volume = Empty({.shape = stack, .grid = {}}, 300, 300);
  PixelOf(&volume, 0, 0, 299)[0] = 255;
  const Image sheet = ContactSheet(volume);
  EXPECT_LE(sheet.width, 8192);
  EXPECT_LE(sheet.height, 8192);
  EXPECT_EQ(sheet.rgb[(static_cast<size_t>(2) * sheet.width + 2) * 3], 255);
}

Image ReadPng(const std::string& path) {
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_file(&png, path.c_str()), 0) << png.message;
  png.format = PNG_FORMAT_RGB;
  Image image{static_cast<int>(png.width), static_cast<int>(png.height),
              std::vector<uint8_t>(PNG_IMAGE_SIZE(png))};
  EXPECT_NE(png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr), 0) << png.message;
  return image;
}

TEST(WritePng, ReadsBackAndReplacesWhole) {
  TempFolder folder;
  const std::string path = folder.Write("picture.png", "an old file");
  Image image{5, 3, {}};
  for (int i = 0; i < 45; ++i) image.rgb.push_back(static_cast<uint8_t>(i * 5));
  ASSERT_THAT(WritePng(path, image), IsOk());
  const Image back = ReadPng(path);
  EXPECT_EQ(back.width, 5);
  EXPECT_EQ(back.height, 3);
  EXPECT_EQ(back.rgb, image.rgb);
  // No other file is left beside it.
  size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.Path(".")))
    ++files;
  EXPECT_EQ(files, 1u);
}

TEST(Palette, KeepsAFewColoursAndMeansOfMany) {
  Image image{16, 16, {}};
  for (int i = 0; i < 256; ++i) {
    const auto level = static_cast<uint8_t>(i);
    image.rgb.insert(image.rgb.end(), {level, static_cast<uint8_t>(i % 2 * 255), 7});
  }
  const PaletteImage exact = ReduceColors(image, 256);
  EXPECT_EQ(exact.colors.size(), 256u);
  for (size_t i = 0; i < 256; ++i) {
    const std::array<uint8_t, 3> want = {image.rgb[i * 3], image.rgb[i * 3 + 1], 7};
    EXPECT_EQ(exact.colors[exact.indices[i]], want) << i;
  }
  const PaletteImage few = ReduceColors(image, 8);
  EXPECT_EQ(few.colors.size(), 8u);
  for (size_t i = 0; i < 256; ++i) {
    const std::array<uint8_t, 3>& color = few.colors[few.indices[i]];
    // Four colours for each of the two rows of 128 levels: 64 levels for a colour, whose mean is in
    // their middle.
    EXPECT_NEAR(color[0], image.rgb[i * 3], 32) << i;
    EXPECT_EQ(color[1], image.rgb[i * 3 + 1])
        << i << ": the colours that differ most are distinguished first";
    EXPECT_EQ(color[2], 7);
  }
  EXPECT_EQ(ReduceColors({2, 1, {1, 2, 3, 1, 2, 3}}, 1).indices, (std::vector<uint8_t>{0, 0}));
}

TEST(Palette, IsInTheFile) {
  const TempFolder folder;
  const std::string path = folder.Path("picture.png");
  const PaletteImage image{3, 1, {{10, 20, 30}, {200, 0, 5}}, {1, 0, 1}};
  ASSERT_THAT(WritePalettePng(path, image), IsOk());
  EXPECT_EQ(ReadPng(path).rgb, (std::vector<uint8_t>{200, 0, 5, 10, 20, 30, 200, 0, 5}));
  EXPECT_EQ(ReadAll(path)[25], 3) << "PNG's colour type";
}

TEST(WritePng, SaysWhereItCannot) {
  EXPECT_THAT(WritePng("/nonexistent/folder/a.png", {1, 1, {1, 2, 3}}),
              Fails(Words{"/nonexistent/folder/a.png", "No such file"}));
  TempFolder folder;
  std::filesystem::create_directory(folder.Path("taken.png"));
  EXPECT_THAT(WritePng(folder.Path("taken.png"), {1, 1, {1, 2, 3}}), Fails(Words{"taken.png"}));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.Path(".")), {}), 1);
}

}  // namespace
}  // namespace voxeld::voxelctl
