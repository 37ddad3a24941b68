#include "display/drivers/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "display/drivers/registry.h"
#include "display/sync/fake_clock.h"

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
  for (const Tone::Curve& curve : info->tone.lut) EXPECT_EQ(curve, Tone::Linear());
}

TEST(Options, StrokesAndMotions) {
  const auto info = Read({{"size", "8x6x10"},
                          {"motion", "sine"},
                          {"travel_mm", "20"},
                          {"dead_begin", "0.1"},
                          {"strokes", "both"}});
  ASSERT_TRUE(info.ok()) << info.status();
  const auto& planar = std::get<PlanarStack>(info->geometry.shape);
  EXPECT_EQ(planar.strokes, 2);
  ASSERT_EQ(planar.positions_mm.size(), 20u);
  EXPECT_NEAR(planar.positions_mm[0], -10 * std::cos(3.14159265358979 * (0.1 + 0.045)), 1e-6);
  EXPECT_EQ(planar.positions_mm[10], -planar.positions_mm[0]);
  EXPECT_EQ(info->layout.slices, 20);
  EXPECT_NE(Refusal({{"motion", "sine"}, {"slice_pitch_mm", "2"}}).find("travel_mm says how far"),
            std::string::npos);
  EXPECT_NE(Refusal({{"travel_mm", "2"}}).find("left out where the motion is stepped"),
            std::string::npos);
  EXPECT_NE(Refusal({{"positions_mm", "1;2;2"}}).find("positions_mm[2] is 2"), std::string::npos);
}

TEST(Options, AHelix) {
  const auto info = Read({{"geometry", "helix"},
                          {"size", "40x30"},
                          {"pitch_mm", "2"},
                          {"slices", "60"},
                          {"blades", "3"},
                          {"hub_mm", "5"},
                          {"travel_mm", "50"},
                          {"left_handed", "true"}});
  ASSERT_TRUE(info.ok()) << info.status();
  const auto& helix = std::get<Helix>(info->geometry.shape);
  EXPECT_EQ(helix.span_turns, 1.0 / 3);
  EXPECT_EQ(helix.radius_mm, 30);
  EXPECT_EQ(helix.height_mm, 50);
  EXPECT_TRUE(helix.left_handed);
  EXPECT_EQ(info->layout, (FrameLayout{.slices = 60, .width = 40, .height = 30}));
  EXPECT_NE(Refusal({{"geometry", "helix"}, {"blades", "3"}, {"span", "0.5"}}).find("span_turns"),
            std::string::npos);
}

TEST(Options, ALattice) {
  const auto info = Read({{"geometry", "lattice"}, {"size", "4x3x2"}, {"pitch_mm", "10"}});
  ASSERT_TRUE(info.ok()) << info.status();
  const auto& lattice = std::get<Lattice>(info->geometry.shape);
  EXPECT_EQ(lattice.width_px, 12);
  ASSERT_EQ(lattice.points_mm.size(), 24u);
  EXPECT_EQ(*lattice.points_mm[13], (Vec3{-5, -10, 5}));
  EXPECT_EQ(info->geometry.grid.nx, 4);
  const auto listed =
      Read({{"geometry", "lattice"}, {"points_mm", "0;0;0;1;2;3;4;5;6"}, {"width", "2"}});
  ASSERT_TRUE(listed.ok()) << listed.status();
  EXPECT_EQ(std::get<Lattice>(listed->geometry.shape).points_mm[3], std::nullopt);
  EXPECT_EQ(listed->layout.slices, 2);
  EXPECT_NE(Refusal({{"geometry", "lattice"}, {"size", "100x100x5"}}).find("40000"),
            std::string::npos);
  std::string many = "0;0;0";
  for (int i = 0; i < 2600; ++i) many += ";1;2;3";
  EXPECT_NE(
      Refusal({{"geometry", "lattice"}, {"points_mm", many}, {"width", "16384"}}).find("accepted"),
      std::string::npos);
  for (int i = 0; i < 40'000; ++i) many += ";1;2;3";
  EXPECT_NE(Refusal({{"geometry", "lattice"}, {"points_mm", many}}).find("at most 40000"),
            std::string::npos);
}

TEST(Options, PanelsTiltAndCorrections) {
  const auto info = Read({{"geometry", "rotor"},
                          {"size", "16x8"},
                          {"slices", "40"},
                          {"eccentricity", "2;0"},
                          {"tilt", "10;-5"},
                          {"panel_pitch_u_mm", "1;2"},
                          {"mirror_u", "true;false"},
                          {"affine", "1;0;0;0.5;0;1;0;0;0;0;1;0"},
                          {"displacement_size", "2x2x2"},
                          {"displacement_low_mm", "-9;-9;-9"},
                          {"displacement_high_mm", "9;9;9"},
                          {"displacement_mm", "0;0;0;0;0;0;0;0;0;0;0;0;0;0;0;0;0;0;0;0;0;1;0;0"}});
  ASSERT_TRUE(info.ok()) << info.status();
  const auto& rotor = std::get<Rotor>(info->geometry.shape);
  EXPECT_EQ(rotor.panels[0].tilt_deg, 10);
  EXPECT_EQ(rotor.panels[1].pitch_u_mm, 2);
  EXPECT_EQ(rotor.panels[1].pitch_v_mm, 1);
  EXPECT_TRUE(rotor.panels[0].mirror_u);
  EXPECT_FALSE(rotor.panels[1].mirror_u);
  ASSERT_TRUE(info->geometry.correction.has_value());
  EXPECT_EQ(info->geometry.correction->affine[3], 0.5);
  EXPECT_EQ(info->geometry.correction->displacement->at_mm[7], (Vec3{1, 0, 0}));
  const auto keystone = Read({{"size", "8x8x2"}, {"keystone_mm", "-4;-4;4;-4;3;4;-3;4"}});
  ASSERT_TRUE(keystone.ok()) << keystone.status();
  EXPECT_EQ(keystone->geometry.correction->homographies.size(), 1u);
  EXPECT_NE(
      Refusal({{"geometry", "rotor"}, {"keystone_mm", "1;2"}}).find("of a planar stack or a helix"),
      std::string::npos);
  EXPECT_NE(Refusal({{"affine", "1;2"}}).find("12 numbers"), std::string::npos);
  EXPECT_NE(Refusal({{"geometry", "rotor"}, {"tilt", "80"}}).find("panels[0].tilt_deg is 80"),
            std::string::npos);
}

TEST(Options, PlanarInFull) {
  const auto info = Read({{"geometry", "planar"},
                          {"size", "64x48"},
                          {"normal", "y"},
                          {"pitch_mm", "0.5"},
                          {"positions_mm", "-3;0;4.5"},
                          {"mirror_u", "true"},
                          {"format", "bitplanes"},
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
                                       .format = PixelFormat::kBitPlanes}));
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
  EXPECT_EQ(Refusal({{"geometry", "cone"}}),
            "display \"d\": geometry is \"cone\"; it must be one of planar, rotor, helix, lattice");
  EXPECT_EQ(Refusal({{"size", "12x0x4"}}),
            "display \"d\": size is \"12x0x4\"; it must be WxHxS, each from 1 to 16384");
  EXPECT_EQ(Refusal({{"rate", "nan"}}),
            "display \"d\": rate is \"nan\"; it must be a number from 0.5 to 10000");
  EXPECT_EQ(Refusal({{"sub_frames", "65"}}),
            "display \"d\": sub_frames is \"65\"; it must be a whole number from 1 to 64");
  EXPECT_NE(Refusal({{"positions_mm", "1;0;0.5"}}).find("strictly within a stroke"),
            std::string::npos);
  EXPECT_NE(Refusal({{"positions_mm", "1;;0"}}).find("numbers with ';'"), std::string::npos);
  EXPECT_NE(Refusal({{"size", "8x8x3"}, {"positions_mm", "0;1"}}).find("2 slices"),
            std::string::npos);
  EXPECT_NE(Refusal({{"geometry", "rotor"}, {"panel_phase", "0;0.5"}}).find("a list of 1"),
            std::string::npos);
  EXPECT_NE(Refusal({{"geometry", "rotor"}, {"panel_phase", "1"}}).find("below 1"),
            std::string::npos);
  EXPECT_NE(Refusal({{"colour", "red"}}).find("unknown option colour (\"red\")"),
            std::string::npos);
  EXPECT_NE(Refusal({{"slices", "100"}}).find("unknown option slices"), std::string::npos);
  EXPECT_NE(Refusal({{"size", "16384x16384x16384"}}).find("at most 17179869184 pixels"),
            std::string::npos);
  EXPECT_NE(Refusal({{"size", "16384x16384x2"}}).find("bytes; at most"), std::string::npos);
}

TEST(Options, ToneCurve) {
  for (const double gamma : {0.5, 1.0, 2.2, 10.0}) {
    for (const double brightness : {1.0, 0.5, 0.001}) {
      const Tone tone = MakeTone({.gamma = {gamma, gamma, gamma}, .brightness = brightness});
      for (const Tone::Curve& curve : tone.lut) {
        EXPECT_EQ(curve[0], 0);
        EXPECT_EQ(curve[255], std::lround(65535 * brightness));
        for (size_t c = 1; c < 256; ++c) {
          EXPECT_GE(curve[c], 1);
          EXPECT_GE(curve[c], curve[c - 1]);
        }
      }
    }
  }
}

TEST(Options, ToneOfEachChannel) {
  const auto info = Read({{"gamma", "1;2;1"},
                          {"white", "1;0.5;0.25"},
                          {"curve_blue", "0;0;1"},
                          {"dither", "blue"},
                          {"density", "even"}});
  ASSERT_TRUE(info.ok()) << info.status();
  EXPECT_EQ(info->tone.dither, Dither::kBlueNoise);
  EXPECT_EQ(info->tone.density, Density::kEven);
  EXPECT_EQ(info->tone.lut[0][51], 13107);
  EXPECT_EQ(info->tone.lut[1][51], std::lround(65535 * 0.5 * 0.04));
  EXPECT_EQ(info->tone.lut[1][255], 32768);
  EXPECT_EQ(info->tone.lut[2][51], 1);  // a lit pixel is never completely dark
  EXPECT_EQ(info->tone.lut[2][204], std::lround(65535 * 0.25 * 0.6));
  EXPECT_NE(Refusal({{"white", "1;1"}}).find("white is \"1;1\"; it must be a number"),
            std::string::npos);
  EXPECT_NE(Refusal({{"curve_red", "0.1;1"}}).find("ascending numbers from 0"), std::string::npos);
}

TEST(Options, FormatsAndBits) {
  const auto info = Read({{"size", "8x8x8"}, {"format", "hub75"}, {"bits", "6"}});
  ASSERT_TRUE(info.ok()) << info.status();
  EXPECT_EQ(info->layout.format, PixelFormat::kHub75);
  EXPECT_EQ(info->layout.bytes(), size_t{8 * 8 * 4 * 6});
  EXPECT_EQ(Read({{"size", "8x8x8"}, {"format", "planes24"}})->layout.bytes(), size_t{8 * 64 * 3});
  EXPECT_NE(Refusal({{"format", "rgb332"}, {"bits", "4"}}).find("0 or 3, as rgb332 has"),
            std::string::npos);
}

TEST(Options, PitchOfVoxels) {
  const auto info = Read({{"size", "8x8x8"}, {"voxel_mm", "1;1;3"}});
  ASSERT_TRUE(info.ok()) << info.status();
  EXPECT_EQ(info->geometry.grid, (VoxelGrid{8, 8, 3, {1, 1, 3}, {-4, -4, -4.5}}));
}

TEST(Registry, KnowsItsDrivers) {
  EXPECT_EQ(DriverNames(),
            (std::vector<std::string>{"fadecandy", "network", "simulated", "voxlink"}));
  sync::FakeClock clock;
  const auto unknown = CreateDisplay({.name = "d", .driver = "hologram"}, clock);
  EXPECT_EQ(unknown.status().message(),
            "display \"d\": there is no driver \"hologram\"; there are fadecandy, network, "
            "simulated, voxlink");
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

TEST(Options, MessagesArePrintableWhateverValuesAre) {
  EXPECT_NE(Refusal({{"size", "8\x1b[2J"}}).find("size is \"8\\x1b[2J\"; it must be "),
            std::string::npos);
  const DisplayOptions options{.name = "d", .driver = "x", .options = {{"si\nze", "\x01"}}};
  OptionReader reader(options);
  EXPECT_NE(reader.Finish().message().find("unknown option si\\nze (\"\\x01\"); known are "),
            std::string::npos);
}

TEST(Options, MisspeltOptionSuggestsTheNearest) {
  const DisplayOptions options{.name = "d", .driver = "x", .options = {{"siez", "8x8x8"}}};
  OptionReader reader(options);
  reader.Size("size", {8, 8, 8}, 3, 3);
  reader.Number("rate", 1, 0, 2);
  EXPECT_THAT(std::string(reader.Finish().message()),
              testing::EndsWith("unknown option siez (\"8x8x8\"); did you mean size?"));
}

}  // namespace
}  // namespace voxeld::display
