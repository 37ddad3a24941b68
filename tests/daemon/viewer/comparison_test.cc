// Tests comparisons of scenes and lights that were counted by hand.
#include "daemon/viewer/comparison.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <random>
#include <tuple>
#include <vector>

namespace voxeld::daemon::viewer {
namespace {

using Cell = std::tuple<int, int, int>;

// Cells of 1 mm from the origin on; the box of places is the grid's.
class ComparisonTest : public ::testing::Test {
 protected:
  void Send(int x, int y, int z, uint32_t rgb) { voxels_[{x, y, z}] = rgb; }
  // Lights a pixel in the middle of a cell, or `off` millimetres from it along x.
  void Show(int x, int y, int z, uint32_t rgb, double off = 0) {
    const auto step = [](double mm, int n) {
      return static_cast<uint16_t>(mm / n * kPlaceSteps + 0.5);
    };
    shown_.x.push_back(step(x + 0.5 + off, grid_.nx));
    shown_.y.push_back(step(y + 0.5, grid_.ny));
    shown_.z.push_back(step(z + 0.5, grid_.nz));
    for (const int shift : {16, 8, 0}) shown_.rgb.push_back(static_cast<uint8_t>(rgb >> shift));
  }

  Comparison Run() {
    const PlaceBox box = {{0, 0, 0},
                          {static_cast<double>(grid_.nx), static_cast<double>(grid_.ny),
                           static_cast<double>(grid_.nz)}};
    int32_t next = 0;
    const auto comparison =
        Compare(grid_, layout_, tone_, reach_, box, shown_,
                [&](int32_t z0, int32_t z1, std::span<uint32_t> out) {
                  EXPECT_EQ(z0, next) << "each plane is read once";
                  next = z1;
                  EXPECT_EQ(out.size(), static_cast<size_t>((z1 - z0) * grid_.nx * grid_.ny));
                  for (const auto& [cell, rgb] : voxels_) {
                    const auto [x, y, z] = cell;
                    if (z < z0 || z >= z1) continue;
                    out[static_cast<size_t>(((z - z0) * grid_.ny + y) * grid_.nx + x)] = rgb;
                  }
                  return absl::OkStatus();
                });
    EXPECT_TRUE(comparison.ok()) << comparison.status();
    EXPECT_EQ(next, grid_.nz);
    return comparison.ok() ? *comparison : Comparison();
  }

  display::VoxelGrid grid_ = {8, 6, 5, {1, 1, 1}, {0, 0, 0}};
  display::FrameLayout layout_;
  Reach reach_;
  display::Tone tone_ = [] {
    display::Tone tone;
    tone.SetCurve(display::Tone::Linear());
    return tone;
  }();
  std::map<Cell, uint32_t> voxels_;
  Points shown_;
};

TEST_F(ComparisonTest, NothingIsTheSameAsNothing) {
  const Comparison c = Run();
  EXPECT_EQ(c.voxels + c.missing + c.pixels + c.stray + c.off, 0u);
  EXPECT_EQ(c.sent.size() + c.difference.size(), 0u);
  EXPECT_EQ(c.mean, 0);
  // The box surrounds the centres of voxels and the places of pixels, which reach farther here.
  EXPECT_EQ(c.box.low_mm, (display::Vec3{0, 0, 0}));
  EXPECT_EQ(c.box.high_mm, (display::Vec3{8, 6, 5}));
  EXPECT_EQ(c.pitch_mm, 1);
}

TEST_F(ComparisonTest, WhatIsShownAsSentDiffersNowhere) {
  int n = 0;
  for (int z = 0; z < grid_.nz; ++z) {
    for (int y = 0; y < grid_.ny; ++y) {
      for (int x = z % 2; x < grid_.nx; x += 2, ++n) {
        const auto rgb = static_cast<uint32_t>(0x010203 * (1 + x + y + z));
        Send(x, y, z, rgb);
        Show(x, y, z, rgb);
      }
    }
  }
  const Comparison c = Run();
  EXPECT_EQ(c.voxels, static_cast<uint64_t>(n));
  EXPECT_EQ(c.pixels, static_cast<uint64_t>(n));
  EXPECT_EQ(c.sent.size(), static_cast<size_t>(n));
  EXPECT_EQ(c.missing + c.stray + c.off, 0u);
  EXPECT_EQ(c.most, 0);
  EXPECT_EQ(c.difference.size(), 0u);
}

TEST_F(ComparisonTest, AVoxelWithoutLightNearIsMissing) {
  Send(1, 1, 1, 0x804020);  // a light in a cell that touches it by a corner
  Show(2, 2, 2, 0x804020);
  Send(5, 1, 1, 0x4080FF);  // one that is two cells away
  Show(7, 1, 1, 0x4080FF);
  const Comparison c = Run();
  EXPECT_EQ(c.voxels, 2u);
  EXPECT_EQ(c.missing, 1u);
  EXPECT_EQ(c.stray, 1u);
  EXPECT_EQ(c.off, 0u);
  ASSERT_EQ(c.difference.size(), 2u);
  // Blue at the voxel, orange at the pixel, each as bright as its greatest channel.
  const auto place = [&](size_t i) { return c.difference.x[i] * 8.0 / kPlaceSteps; };
  const size_t missing = place(0) < place(1) ? 0 : 1, stray = 1 - missing;
  EXPECT_NEAR(place(missing), 5.5, 0.001);
  EXPECT_NEAR(place(stray), 7.5, 0.001);
  EXPECT_EQ(c.difference.rgb[missing * 3 + 2], 255);
  EXPECT_LT(c.difference.rgb[missing * 3], 128);
  EXPECT_EQ(c.difference.rgb[stray * 3], 255);
  EXPECT_LT(c.difference.rgb[stray * 3 + 2], 128);
}

TEST_F(ComparisonTest, ThePlanesBetweenDoNotHideALightThatIsTooFar) {
  Send(4, 3, 0, 0xFFFFFF);
  Show(4, 3, 2, 0xFFFFFF);
  EXPECT_EQ(Run().missing, 1u);
  shown_ = {};
  Show(4, 3, 1, 0xFFFFFF);
  const Comparison near = Run();
  EXPECT_EQ(near.missing + near.stray, 0u);
}

TEST_F(ComparisonTest, TheVoxelThatAPixelIsLikestCounts) {
  Send(2, 2, 2, 0xFF0000);
  Send(3, 2, 2, 0x00FF00);
  Show(2, 2, 2, 0x00F000);  // in the cell of the red one, like the green one except for 15
  Show(3, 2, 2, 0xC80000);  // 55 darker than the red one
  const Comparison c = Run();
  EXPECT_EQ(c.missing + c.stray, 0u);
  EXPECT_EQ(c.off, 1u);
  EXPECT_EQ(c.most, 55);
  EXPECT_DOUBLE_EQ(c.mean, (15 + 55) / 2.0);
  ASSERT_EQ(c.difference.size(), 1u);
  EXPECT_EQ(c.difference.rgb[2], 55) << "too dark: blue";
}

TEST_F(ComparisonTest, ALevelOfTheDisplayIsNoDifference) {
  layout_.format = display::PixelFormat::kRgb332;  // levels are 36 apart, blue's 85
  Send(1, 1, 1, 0x808080);
  Show(1, 1, 1, 0x929200);
  EXPECT_EQ(Run().off, 1u) << "blue is 128 off";
  shown_ = {};
  Show(1, 1, 1, 0x6D9255);
  const Comparison c = Run();
  EXPECT_EQ(c.off, 0u);
  EXPECT_EQ(c.most, 0x80 - 0x55);
  layout_.sub_frames = 4;  // with which levels in between are possible: 21 of blue
  EXPECT_EQ(Run().off, 1u);
}

TEST_F(ComparisonTest, ColorsAreWhatTheDisplaysCurvesMakeOfThem) {
  for (auto& curve : tone_.lut) {
    for (size_t c = 0; c < curve.size(); ++c)
      curve[c] = static_cast<uint16_t>(c * c);  // about gamma 2
  }
  Send(1, 1, 1, 0x800000);
  Show(1, 1, 1, 0x400000);  // 128² of 65535 is 63.75 of 255
  const Comparison c = Run();
  EXPECT_EQ(c.most, 0);
  EXPECT_EQ(c.sent.rgb[0], 64);
}

TEST_F(ComparisonTest, WhereADisplayIsMadeEvenColorAloneCounts) {
  Send(1, 1, 1, 0xFF8000);
  Show(1, 1, 1, 0x402000);
  EXPECT_EQ(Run().most, 0xFF - 0x40);
  tone_.density = display::Density::kEven;
  EXPECT_EQ(Run().most, 0);
  Show(1, 1, 1, 0x404040);
  EXPECT_EQ(Run().off, 1u) << "white is another colour";
}

TEST_F(ComparisonTest, LightBeyondTheGridIsNearOnlyWithinAVoxel) {
  Send(0, 0, 0, 0xFFFFFF);
  Show(0, 0, 0, 0xFFFFFF, -0.5);
  grid_.origin_mm = {0.8, 0, 0};  // the light is now in the cell before the first
  EXPECT_EQ(Run().stray, 0u);
  grid_.origin_mm = {1.8, 0, 0};  // in the one before that
  const Comparison c = Run();
  EXPECT_EQ(c.stray, 1u);
  EXPECT_EQ(c.missing, 1u);
}

TEST_F(ComparisonTest, ReachIsWhatALightStandsFor) {
  Send(1, 1, 2, 0xFFFFFF);
  Show(4, 1, 2, 0xFFFFFF);
  EXPECT_EQ(Run().missing, 1u);
  reach_ = {3, 1, 1};
  const Comparison c = Run();
  EXPECT_EQ(c.missing + c.stray, 0u);
  shown_ = {};
  Show(1, 1, 0, 0xFFFFFF);
  EXPECT_EQ(Run().stray, 1u);
  reach_ = {1, 1, 2};
  EXPECT_EQ(Run().stray, 0u);
  EXPECT_EQ(Run().missing, 0u);
  shown_ = {};
  Show(1, 4, 4, 0xFFFFFF);
  EXPECT_EQ(Run().stray, 1u);
  reach_ = {1, 3, 2};
  EXPECT_EQ(Run().stray, 0u);
  EXPECT_EQ(Run().missing, 0u);
}

TEST_F(ComparisonTest, RandomPixelsAreNearAsCountedOneByOne) {
  std::mt19937 random(7);
  for (int turn = 0; turn < 40; ++turn) {
    voxels_.clear();
    shown_ = {};
    reach_ = {1 + static_cast<int>(random() % 3), 1 + static_cast<int>(random() % 3),
              1 + static_cast<int>(random() % 3)};
    std::vector<Cell> pixels;
    for (int i = 0; i < 6; ++i) {
      const int x = static_cast<int>(random() % 8), y = static_cast<int>(random() % 6),
                z = static_cast<int>(random() % 5);
      pixels.emplace_back(x, y, z);
      Show(x, y, z, 0x808080);
      Send(static_cast<int>(random() % 8), static_cast<int>(random() % 6),
           static_cast<int>(random() % 5), 0x808080);
    }
    const auto near = [&](const Cell& a, const Cell& b) {
      return std::abs(std::get<0>(a) - std::get<0>(b)) <= reach_.x &&
             std::abs(std::get<1>(a) - std::get<1>(b)) <= reach_.y &&
             std::abs(std::get<2>(a) - std::get<2>(b)) <= reach_.z;
    };
    uint64_t missing = 0, stray = 0;
    for (const auto& [voxel, rgb] : voxels_) {
      missing +=
          std::none_of(pixels.begin(), pixels.end(), [&](const Cell& p) { return near(p, voxel); });
    }
    for (const Cell& pixel : pixels) {
      stray += std::none_of(voxels_.begin(), voxels_.end(),
                            [&](const auto& v) { return near(v.first, pixel); });
    }
    const Comparison c = Run();
    EXPECT_EQ(c.missing, missing);
    EXPECT_EQ(c.stray, stray);
  }
}

TEST(ReachOf, IsHalfTheWayToTheNextPixel) {
  display::PlanarStack stack;
  stack.width_px = 4, stack.height_px = 4;
  stack.positions_mm = {-5, 0, 5};
  display::Geometry planes{.shape = stack};
  planes.grid = {4, 4, 18, {1, 1, 0.8333}, {-2, -2, -7.5}};
  EXPECT_EQ(ReachOf(planes, display::Sampling::kMax),
            (Reach{1, 1, 4}));  // 2.5 mm are three cells, and half a cell
  EXPECT_EQ(ReachOf(planes, display::Sampling::kWeighted), (Reach{2, 2, 7}));
  stack.normal = display::PlanarStack::Normal::kY;
  planes.shape = stack;
  planes.grid = {4, 3, 4, {1, 5, 1}, {-2, -7.5, -2}};
  EXPECT_EQ(ReachOf(planes, display::Sampling::kMax), (Reach{1, 1, 1}));

  display::Rotor rotor;
  rotor.slices_per_turn = 36, rotor.width_px = 20, rotor.height_px = 4;
  rotor.panels = {{}};
  display::Geometry turning{.shape = rotor};
  turning.grid = {20, 20, 4, {1, 1, 1}, {-10, -10, -2}};
  EXPECT_EQ(ReachOf(turning, display::Sampling::kMax),
            (Reach{2, 2, 1}));  // the rim's 10 degrees are 1.7 mm

  display::Lattice lattice;
  lattice.width_px = 1, lattice.points_mm = {display::Vec3{}}, lattice.cell_mm = {10, 2, 2};
  display::Geometry lights{.shape = lattice};
  lights.grid = {10, 2, 2, {1, 1, 1}, {-5, -1, -1}};
  EXPECT_EQ(ReachOf(lights, display::Sampling::kMax), (Reach{6, 2, 2}));
}

TEST_F(ComparisonTest, AFailedReadIsTheAnswer) {
  const auto failed = Compare(grid_, layout_, tone_, reach_, {{0, 0, 0}, {1, 1, 1}}, shown_,
                              [](int32_t, int32_t, std::span<uint32_t>) {
                                return absl::ResourceExhaustedError("no memory");
                              });
  EXPECT_TRUE(absl::IsResourceExhausted(failed.status()));
}

TEST(CheckComparable, ManyLitPixelsAreNot) {
  EXPECT_TRUE(CheckComparable({1, 1, 1, {1, 1, 1}, {}}, kMostPixels).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(CheckComparable({1, 1, 1, {1, 1, 1}, {}}, kMostPixels + 1)));
}

TEST_F(ComparisonTest, OfManyPointsAPartIsDrawnAndAllAreCounted) {
  grid_ = {128, 128, 80, {1, 1, 1}, {0, 0, 0}};
  const auto c = Compare(grid_, layout_, tone_, reach_, {{0, 0, 0}, {128, 128, 80}}, shown_,
                         [](int32_t, int32_t, std::span<uint32_t> out) {
                           std::fill(out.begin(), out.end(), 0xFFFFFFu);
                           return absl::OkStatus();
                         });
  ASSERT_TRUE(c.ok());
  EXPECT_EQ(c->voxels, 128u * 128 * 80);
  EXPECT_EQ(c->missing, c->voxels);
  for (const Points* points : {&c->sent, &c->difference}) {
    EXPECT_LT(points->size(), Comparison::kMostPoints);
    EXPECT_GE(points->size(), Comparison::kMostPoints / 2);
    EXPECT_EQ(points->rgb.size(), 3 * points->size());
    // The last plane, like the first.
    EXPECT_LT(points->z.front(), kPlaceSteps / 80);
    EXPECT_GT(points->z.back(), kPlaceSteps - kPlaceSteps / 80);
  }
}

TEST(CheckComparable, LargeGridsAreNot) {
  EXPECT_TRUE(CheckComparable({512, 512, 1024, {1, 1, 1}, {}}).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(CheckComparable({512, 512, 1025, {1, 1, 1}, {}})));
}

}  // namespace
}  // namespace voxeld::daemon::viewer
