#include "display/drivers/options.h"

#include <map>
#include <string>

#include "display/drivers/registry.h"
#include "display/sync/fake_clock.h"
#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

absl::StatusOr<DisplayInfo> Read(std::map<std::string, std::string> values) {
  const DisplayOptions options{.name = "d", .driver = "x", .options = std::move(values)};
  OptionReader reader(options);
  return ReadDisplayInfo(options, reader);
}

std::string Refusal(std::map<std::string, std::string> values) {
  const auto info = Read(std::move(values));
  if (info.ok()) return "accepted";
  EXPECT_EQ(info.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(info.status().message());
}

TEST(Options, DefaultsAreAPlanarCube) {
  const auto info = Read({});
  ASSERT_TRUE(info.ok()) << info.status();
  EXPECT_EQ(info->name, "d");
  EXPECT_EQ(info->layout, (FrameLayout{.slices = 128, .width = 128, .height = 128}));
  EXPECT_EQ(info->volumes_per_second, 30);
  const auto& planar = std::get<PlanarStack>(info->geometry.shape);
  EXPECT_EQ(planar.positions_mm.front(), -63.5);
  EXPECT_EQ(planar.positions_mm.back(), 63.5);
  EXPECT_EQ(info->geometry.grid.nx, 128);
  EXPECT_EQ(info->geometry.grid.nz, 128);
  for (int c = 0; c < 256; ++c) EXPECT_EQ(info->tone.lut[static_cast<size_t>(c)], c * 257);
}

TEST(Options, PlanarInFull) {
  const auto info = Read({{"geometry", "planar"},
                          {"size", "64x48"},
                          {"normal", "y"},
                          {"pitch_mm", "0.5"},
                          {"positions_mm", "-3;0;4.5"},
                          {"mirror_u", "true"},
                          {"format", "bitplanes3"},
                          {"sub_frames", "4"},
                          {"rate", "20"},
                          {"dither", "none"},
                          {"sampling", "weighted"}});
  ASSERT_TRUE(info.ok()) << info.status();
  const auto& planar = std::get<PlanarStack>(info->geometry.shape);
  EXPECT_EQ(planar.normal, PlanarStack::Normal::kY);
  EXPECT_EQ(planar.positions_mm, (std::vector<double>{-3, 0, 4.5}));
  EXPECT_TRUE(planar.mirror_u);
  EXPECT_EQ(info->layout, (FrameLayout{.slices = 3,
                                       .width = 64,
                                       .height = 48,
                                       .sub_frames = 4,
                                       .format = PixelFormat::kBitPlanes3}));
  EXPECT_EQ(info->tone.dither, Dither::kNone);
  EXPECT_EQ(info->tone.sampling, Sampling::kWeighted);
}

TEST(Options, RotorInFull) {
  const auto info = Read({{"geometry", "rotor"},
                          {"size", "128x64"},
                          {"slices", "240"},
                          {"pitch_mm", "2"},
                          {"eccentricity", "13.5;0.375"},
                          {"panel_phase", "0;0.5"},
                          {"clockwise", "true"},
                          {"format", "rgb332"}});
  ASSERT_TRUE(info.ok()) << info.status();
  const auto& rotor = std::get<Rotor>(info->geometry.shape);
  ASSERT_EQ(rotor.panels.size(), 2u);
  EXPECT_EQ(rotor.panels[0].eccentricity_mm, 27);
  EXPECT_EQ(rotor.panels[1].eccentricity_mm, 0.75);
  EXPECT_EQ(rotor.panels[1].phase_turns, 0.5);
  EXPECT_TRUE(rotor.clockwise);
  EXPECT_EQ(info->layout.slices, 480);
}

TEST(Options, RefusalsNameKeyValueAndWhatIsRight) {
  EXPECT_EQ(Refusal({{"geometry", "helix"}}),
            "display \"d\": geometry is \"helix\"; it must be one of planar, rotor");
  EXPECT_EQ(Refusal({{"size", "12x0x4"}}),
            "display \"d\": size is \"12x0x4\"; it must be WxHxS, each from 1 to 16384");
  EXPECT_EQ(Refusal({{"rate", "nan"}}),
            "display \"d\": rate is \"nan\"; it must be a number from 0.5 to 10000");
  EXPECT_EQ(Refusal({{"sub_frames", "65"}}),
            "display \"d\": sub_frames is \"65\"; it must be a whole number from 1 to 64");
  EXPECT_NE(Refusal({{"positions_mm", "1;0"}}).find("strictly ascending"), std::string::npos);
  EXPECT_NE(Refusal({{"positions_mm", "1;;0"}}).find("numbers with ';'"), std::string::npos);
  EXPECT_NE(Refusal({{"size", "8x8x3"}, {"positions_mm", "0;1"}}).find("2 slices"),
            std::string::npos);
  EXPECT_NE(Refusal({{"geometry", "rotor"}, {"panel_phase", "0;0.5"}}).find("a list of 1"),
            std::string::npos);
  EXPECT_NE(Refusal({{"geometry", "rotor"}, {"panel_phase", "1"}}).find("below 1"),
            std::string::npos);
  EXPECT_NE(Refusal({{"colour", "red"}}).find("there is no option colour (\"red\")"),
            std::string::npos);
  EXPECT_NE(Refusal({{"slices", "100"}}).find("there is no option slices"), std::string::npos);
  EXPECT_NE(Refusal({{"size", "16384x16384x16384"}}).find("bytes; at most"), std::string::npos);
}

TEST(Options, ToneCurve) {
  for (const double gamma : {0.5, 1.0, 2.2, 10.0}) {
    for (const double brightness : {1.0, 0.5, 0.001}) {
      const Tone tone = MakeTone(gamma, brightness, Dither::kNone, Sampling::kMax);
      EXPECT_EQ(tone.lut[0], 0);
      EXPECT_EQ(tone.lut[255], std::lround(65535 * brightness));
      for (size_t c = 1; c < 256; ++c) {
        EXPECT_GE(tone.lut[c], 1);
        EXPECT_GE(tone.lut[c], tone.lut[c - 1]);
      }
    }
  }
}

TEST(Registry, KnowsItsDrivers) {
  EXPECT_EQ(DriverNames(), (std::vector<std::string>{"fadecandy", "simulated", "voxlink"}));
  sync::FakeClock clock;
  const auto unknown = CreateDisplay({.name = "d", .driver = "hologram"}, clock);
  EXPECT_EQ(
      unknown.status().message(),
      "display \"d\": there is no driver \"hologram\"; there are fadecandy, simulated, voxlink");
  const auto bad = CreateDisplay(
      {.name = "d", .driver = "simulated", .options = {{"faults", "fire@t1"}}}, clock);
  EXPECT_EQ(bad.status().code(), absl::StatusCode::kInvalidArgument);
  const auto small = CreateDisplay(
      {.name = "d", .driver = "simulated", .options = {{"receive_buffer", "65536"}}}, clock);
  EXPECT_EQ(small.status().code(), absl::StatusCode::kInvalidArgument);
  const auto display =
      CreateDisplay({.name = "d", .driver = "simulated", .options = {{"size", "8x8x8"}}}, clock);
  ASSERT_TRUE(display.ok());
  EXPECT_EQ((*display)->info().driver, "simulated");
  EXPECT_EQ((*display)->state(), DisplayState::kStopped);
}

}  // namespace
}  // namespace voxeld::display
