#include "display/drivers/voxlink/capabilities.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <random>
#include <string>

#include "gtest/gtest.h"
#include "tests/display/drivers/made_up_device.h"

namespace voxeld::display::voxlink {
namespace {

DeviceCapabilities Planar() {
  DeviceCapabilities device = MadeUpDevice(0x0103);
  PlanarStack planar;
  planar.normal = PlanarStack::Normal::kY;
  planar.width_px = 1024;
  planar.height_px = 768;
  planar.pitch_u_mm = 0.1;
  planar.pitch_v_mm = 0.2;
  planar.positions_mm = {-1.5, 0, 0.25};
  planar.thickness_mm = 0.5;
  planar.mirror_v = true;
  device.geometry.shape = planar;
  return *ParseCapabilities(EncodeCapabilities(device));  // which counts slices and pixels
}

DeviceCapabilities RotorDevice() {
  DeviceCapabilities device = Planar();
  Rotor rotor;
  rotor.slices_per_turn = 360;
  rotor.width_px = 128;
  rotor.height_px = 64;
  rotor.clockwise = true;
  rotor.panels = {{.pitch_u_mm = 2.5,
                   .pitch_v_mm = 2.6,
                   .eccentricity_mm = 13.5,
                   .shift_u_mm = -1,
                   .shift_v_mm = 3,
                   .phase_turns = 0.5,
                   .mirror_u = true},
                  {.eccentricity_mm = -0.375}};
  device.geometry.shape = rotor;
  return *ParseCapabilities(EncodeCapabilities(device));
}

Geometry LatticeGeometry() {
  return {.shape = Lattice{.width_px = 2, .points_mm = {Vec3{1, 2, 3}, std::nullopt}}, .grid = {}};
}

FrameLayout LayoutOf(const DeviceCapabilities& device) {
  const Capabilities& fixed = device.fixed;
  return {.slices = static_cast<int32_t>(fixed.slices),
          .width = static_cast<int32_t>(fixed.width),
          .height = static_cast<int32_t>(fixed.height)};
}

TEST(Capabilities, ShapesGoThereAndBack) {
  for (const DeviceCapabilities& device : {Planar(), RotorDevice()}) {
    const auto block = EncodeCapabilities(device);
    const auto parsed = ParseCapabilities(block);
    ASSERT_TRUE(parsed.ok()) << parsed.status().message();
    EXPECT_EQ(parsed->geometry, device.geometry);
    EXPECT_EQ(EncodeCapabilities(*parsed), block);
  }
}

TEST(Capabilities, LieWhereTheDocumentSays) {
  const auto block = EncodeCapabilities(RotorDevice());
  ASSERT_EQ(block.size(), 64u + 8 + 2 * 56);
  const auto u8 = [&](size_t at) { return std::to_integer<int>(block[at]); };
  EXPECT_EQ(u8(0), 184);   // total length
  EXPECT_EQ(u8(4), 0x03);  // version
  EXPECT_EQ(u8(5), 0x01);
  EXPECT_EQ(u8(6), 0x05);         // formats
  EXPECT_EQ(u8(7), 4);            // sub-frames
  EXPECT_EQ(u8(20), 720 & 0xFF);  // slices
  EXPECT_EQ(u8(21), 720 >> 8);
  EXPECT_EQ(u8(24), 128);  // width
  EXPECT_EQ(u8(28), 64);   // height
  EXPECT_EQ(u8(64), 2);    // rotor
  EXPECT_EQ(u8(65), 1);    // clockwise
  EXPECT_EQ(u8(66), 2);    // panels
  double eccentricity = 0;
  std::memcpy(&eccentricity, block.data() + 72 + 16, 8);
  EXPECT_EQ(eccentricity, 13.5);
}

TEST(Capabilities, EveryTruncationIsRefused) {
  for (const DeviceCapabilities& device : {Planar(), RotorDevice()}) {
    const auto block = EncodeCapabilities(device);
    for (size_t size = 0; size < block.size(); ++size) {
      EXPECT_FALSE(ParseCapabilities(std::span(block).first(size)).ok()) << size;
    }
  }
}

TEST(Capabilities, HostileBlocksAreRefusedOrMakeSense) {
  std::mt19937 random(3);
  const auto planar = EncodeCapabilities(Planar());
  const auto rotor = EncodeCapabilities(RotorDevice());
  int accepted = 0;
  for (int round = 0; round < 20'000; ++round) {
    auto block = round % 2 == 0 ? planar : rotor;
    for (uint32_t i = 0; i < 1 + random() % 4; ++i) {
      block[random() % block.size()] = static_cast<std::byte>(random());
    }
    const auto parsed = ParseCapabilities(block);
    if (!parsed.ok()) {
      EXPECT_EQ(parsed.status().code(), absl::StatusCode::kDataLoss);
      continue;
    }
    ++accepted;
    EXPECT_GE(parsed->fixed.slices, 1u);
    EXPECT_GE(parsed->fixed.receive_buffer / 4, parsed->fixed.max_payload);
    EXPECT_EQ(EncodeCapabilities(*parsed).size(), block.size());
  }
  EXPECT_GT(accepted, 100);
}

TEST(Capabilities, RefusalsNameFieldAndValue) {
  const auto refusal = [](auto change) {
    auto block = EncodeCapabilities(Planar());
    auto fixed = Load<Capabilities>(block);
    change(fixed);
    std::memcpy(block.data(), &fixed, sizeof(fixed));
    const auto parsed = ParseCapabilities(block);
    return parsed.ok() ? std::string() : std::string(parsed.status().message());
  };
  EXPECT_EQ(refusal([](Capabilities& c) { c.version = 0x0200; }),
            "the device's capabilities: version is 2.0; it must be 1.x");
  EXPECT_EQ(refusal([](Capabilities& c) { c.volume_buffers = 2; }),
            "the device's capabilities: volume_buffers is 2; it must be 3 or more");
  EXPECT_EQ(refusal([](Capabilities& c) { c.slices = 4; }),
            "the device's capabilities: positions is 3; it must be 4, as many as slices");
  EXPECT_EQ(refusal([](Capabilities& c) { c.receive_buffer = 4 * 65536; }),
            "the device's capabilities: receive_buffer is 262144; it must be 4 packets of "
            "max_payload and their headers, or more");
}

TEST(Capabilities, RatesAndTimesMustAgree) {
  const auto refusal = [](auto change) {
    auto block = EncodeCapabilities(Planar());
    auto fixed = Load<Capabilities>(block);
    change(fixed);
    std::memcpy(block.data(), &fixed, sizeof(fixed));
    return std::string(ParseCapabilities(block).status().message());
  };
  EXPECT_EQ(refusal([](Capabilities& c) { c.nominal_rate_mhz = 999; }),
            "the device's capabilities: nominal_rate is 999; it must be from min_rate (1000) to "
            "max_rate (30000)");
  EXPECT_EQ(refusal([](Capabilities& c) { c.nominal_rate_mhz = 30'001; }),
            "the device's capabilities: nominal_rate is 30001; it must be from min_rate (1000) to "
            "max_rate (30000)");
  EXPECT_EQ(refusal([](Capabilities& c) { c.formats = 0; }),
            "the device's capabilities: formats is 0; it must be a bit or more, one for each pixel "
            "format");
  EXPECT_EQ(refusal([](Capabilities& c) { c.keepalive_ms = 101; }),
            "the device's capabilities: keepalive_ms is 101; it must be 100");
  EXPECT_EQ(refusal([](Capabilities& c) { c.watchdog_ms = 250; }),
            "the device's capabilities: watchdog_ms is 250; it must be 0 without feature bit 0 "
            "(watchdog)");
  EXPECT_EQ(refusal([](Capabilities& c) { c.features = kFeatureWatchdog; }),
            "the device's capabilities: watchdog_ms is 0; it must be 250 with feature bit 0 "
            "(watchdog)");
  EXPECT_EQ(refusal([](Capabilities& c) {
              c.features = kFeatureWatchdog;
              c.watchdog_ms = 250;
            }),
            "");
}

TEST(Capabilities, TheDeviceMustBeAsConfigured) {
  const DeviceCapabilities device = Planar();
  const FrameLayout layout = LayoutOf(device);
  Geometry geometry = device.geometry;
  geometry.grid.nx = 5;  // not compared
  EXPECT_TRUE(CheckCapabilities(device, geometry, layout).ok());

  FrameLayout other = layout;
  other.slices = 4;
  EXPECT_EQ(std::string(CheckCapabilities(device, geometry, other).message()),
            "the display is configured as a planar stack of 4 slices of 1024x768 pixels, but the "
            "device is a planar stack of 3 slices of 1024x768 pixels");
  EXPECT_FALSE(CheckCapabilities(device, RotorDevice().geometry, layout).ok());
  other = layout;
  other.format = PixelFormat::kRgb332;
  EXPECT_FALSE(CheckCapabilities(device, geometry, other).ok());
  other = layout;
  other.sub_frames = 5;
  EXPECT_FALSE(CheckCapabilities(device, geometry, other).ok());
  std::get<PlanarStack>(geometry.shape).positions_mm[1] = 0.01;
  EXPECT_FALSE(CheckCapabilities(device, geometry, layout).ok());
}

// A calibration replaces how the device is assembled; the parts of which it is made must still be
// the device's.
TEST(Capabilities, OfACalibratedDisplayWhatItWasPutTogetherLikeDoesNotCount) {
  const DeviceCapabilities device = RotorDevice();
  const FrameLayout layout = LayoutOf(device);
  const auto check = [&](const std::function<void(Rotor&)>& change, bool calibrated) {
    Geometry geometry = device.geometry;
    change(std::get<Rotor>(geometry.shape));
    return CheckCapabilities(device, geometry, layout, calibrated).ok();
  };
  const std::function<void(Rotor&)> put_together[] = {
      [](Rotor& r) { r.clockwise = !r.clockwise; },
      [](Rotor& r) { r.panels[0].eccentricity_mm += 0.2; },
      [](Rotor& r) { r.panels[0].shift_u_mm = 7; },
      [](Rotor& r) { r.panels[1].shift_v_mm = 7; },
      [](Rotor& r) { r.panels[1].phase_turns = 0.25; },
      [](Rotor& r) { r.panels[1].mirror_u = true; },
      [](Rotor& r) { r.panels[0].tilt_deg = 3; }};
  for (const auto& change : put_together) {
    EXPECT_FALSE(check(change, false));
    EXPECT_TRUE(check(change, true));
  }
  EXPECT_FALSE(check([](Rotor& r) { r.panels[0].pitch_u_mm = 3; }, true));
  EXPECT_FALSE(check([](Rotor& r) { r.panels.pop_back(); }, true));

  const DeviceCapabilities stack = Planar();
  Geometry turned = stack.geometry;
  auto& planar = std::get<PlanarStack>(turned.shape);
  planar.mirror_u = !planar.mirror_u;
  std::reverse(planar.positions_mm.begin(), planar.positions_mm.end());
  EXPECT_FALSE(CheckCapabilities(stack, turned, LayoutOf(stack)).ok());
  EXPECT_TRUE(CheckCapabilities(stack, turned, LayoutOf(stack), true).ok());
  planar.positions_mm[0] += 0.1;
  EXPECT_FALSE(CheckCapabilities(stack, turned, LayoutOf(stack), true).ok());
}

DeviceCapabilities With(Geometry geometry) {
  DeviceCapabilities device = Planar();
  device.geometry = std::move(geometry);
  return device;
}

TEST(Capabilities, EveryShapeGoesThereAndBack) {
  Helix helix;
  helix.slices_per_turn = 90;
  helix.width_px = 20;
  helix.height_px = 18;
  helix.pitch_v_mm = 1.25;
  helix.blades = 2;
  helix.span_turns = 0.4;
  helix.height_mm = 33;
  helix.hub_mm = 2;
  helix.radius_mm = 9;
  helix.phase_turns = 0.125;
  helix.left_handed = true;
  helix.mirror_v = true;
  PlanarStack strokes = std::get<PlanarStack>(Planar().geometry.shape);
  strokes.strokes = 2;
  strokes.positions_mm = {-1, 0, 2, 3, 0.5, -2};
  Rotor tilted = std::get<Rotor>(RotorDevice().geometry.shape);
  tilted.panels[1].tilt_deg = -12.7F;
  for (const Geometry& geometry :
       {Geometry{.shape = helix, .grid = {}}, Geometry{.shape = strokes, .grid = {}},
        Geometry{.shape = tilted, .grid = {}}, LatticeGeometry()}) {
    const auto block = EncodeCapabilities(With(geometry));
    const auto parsed = ParseCapabilities(block);
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    EXPECT_EQ(parsed->geometry, geometry);
    EXPECT_EQ(EncodeCapabilities(*parsed), block);
    EXPECT_EQ(CheckCapabilities(*parsed, geometry, LayoutOf(*parsed)), absl::OkStatus());
    for (size_t size = 0; size < block.size(); ++size) {
      EXPECT_FALSE(ParseCapabilities(std::span(block).first(size)).ok()) << size;
    }
  }
}

TEST(Capabilities, WhatIsWrongWithAShapeIsSaid) {
  auto block = EncodeCapabilities(With(LatticeGeometry()));
  block[64 + 4] = std::byte{3};  // lights
  EXPECT_NE(ParseCapabilities(block).status().message().find("lights is 3; it must be 2"),
            std::string::npos);
  Helix helix;
  helix.slices_per_turn = 9;
  helix.width_px = helix.height_px = 4;
  helix.blades = 3;
  helix.span_turns = 0.5;
  const absl::Status status =
      ParseCapabilities(EncodeCapabilities(With({.shape = helix, .grid = {}}))).status();
  EXPECT_NE(status.message().find("span_turns is 0.5"), std::string::npos) << status;
  // Nor is one shape mistaken for another.
  EXPECT_FALSE(
      CheckCapabilities(With(LatticeGeometry()), Planar().geometry, LayoutOf(Planar())).ok());
}

}  // namespace
}  // namespace voxeld::display::voxlink
