// Tests blocks of capabilities that are wrong in each field of each shape, byte by byte as
// documented, and their errors.
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "display/drivers/voxlink/capabilities.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/made_up_device.h"

namespace voxeld::display::voxlink {
namespace capabilities_shapes_test {

using ::testing::HasSubstr;
using Block = std::vector<std::byte>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNaN = std::nan("");

DeviceCapabilities Device(Geometry geometry) {
  DeviceCapabilities device = MadeUpDevice(0x0100);
  device.geometry = std::move(geometry);
  return device;
}

Geometry Planar() {
  PlanarStack planar;
  planar.width_px = 8;
  planar.height_px = 6;
  planar.positions_mm = {-1.5, 0, 0.25};
  planar.thickness_mm = 0.5;
  return {.shape = planar, .grid = {}};
}
Geometry RotorOf(bool clockwise = false) {
  Rotor rotor;
  rotor.slices_per_turn = 36;
  rotor.width_px = 8;
  rotor.height_px = 4;
  rotor.clockwise = clockwise;
  rotor.panels = {{.pitch_u_mm = 2.5, .pitch_v_mm = 2.6}, {.eccentricity_mm = -0.375}};
  return {.shape = rotor, .grid = {}};
}
Geometry HelixOf(bool clockwise = false) {
  Helix helix;
  helix.slices_per_turn = 90;
  helix.width_px = 20;
  helix.height_px = 18;
  helix.blades = 2;
  helix.span_turns = 0.4;
  helix.height_mm = 33;
  helix.hub_mm = 2;
  helix.radius_mm = 9;
  helix.clockwise = clockwise;
  return {.shape = helix, .grid = {}};
}
Geometry LatticeOf(int rows = 1) {
  Lattice lattice;
  lattice.width_px = 2;
  for (int i = 0; i < 2 * rows; ++i) lattice.points_mm.push_back(Vec3{1.0 * i, 2, 3});
  return {.shape = lattice, .grid = {}};
}

template <typename T>
void Put(Block& block, size_t at, T value) {
  ASSERT_LE(at + sizeof(value), block.size());
  std::memcpy(block.data() + at, &value, sizeof(value));
}
void SetFixed(Block& block, const std::function<void(Capabilities&)>& change) {
  auto fixed = Load<Capabilities>(block);
  change(fixed);
  std::memcpy(block.data(), &fixed, sizeof(fixed));
}
// Changes the length, including the one stated in the block.
void Resize(Block& block, size_t size) {
  block.resize(size);
  SetFixed(block, [&](Capabilities& c) { c.total_length = static_cast<uint32_t>(size); });
}

struct Wrong {
  const char* name;
  Geometry (*good)();
  std::function<void(Block&)> spoil;
  const char* message;
};

constexpr size_t kShape = sizeof(Capabilities);
constexpr size_t kPanel = kShape + sizeof(RotorShape);

const Wrong kWrongs[] = {
    {"slices_none", Planar, [](Block& b) { SetFixed(b, [](auto& c) { c.slices = 0; }); },
     "slices is 0; it must be from 1"},
    {"width_none", Planar, [](Block& b) { SetFixed(b, [](auto& c) { c.width = 0; }); },
     "width is 0; it must be from 1"},
    {"width_many", Planar, [](Block& b) { SetFixed(b, [](auto& c) { c.width = 1u << 31; }); },
     "width is 2147483648"},
    {"height_none", Planar, [](Block& b) { SetFixed(b, [](auto& c) { c.height = 0; }); },
     "height is 0; it must be from 1"},
    {"height_many", Planar, [](Block& b) { SetFixed(b, [](auto& c) { c.height = 1u << 31; }); },
     "height is 2147483648"},
    {"sub_frames_none", Planar,
     [](Block& b) { SetFixed(b, [](auto& c) { c.max_sub_frames = 0; }); },
     "max_sub_frames is 0; it must be from 1 to 64"},
    {"sub_frames_many", Planar,
     [](Block& b) { SetFixed(b, [](auto& c) { c.max_sub_frames = 65; }); }, "max_sub_frames is 65"},
    {"payload_small", Planar, [](Block& b) { SetFixed(b, [](auto& c) { c.max_payload = 1; }); },
     "max_payload is 1; it must be from"},
    {"payload_great", Planar,
     [](Block& b) { SetFixed(b, [](auto& c) { c.max_payload = (1u << 24) + 1; }); },
     "max_payload is 16777217"},
    {"rate_none", Planar,
     [](Block& b) { SetFixed(b, [](auto& c) { c.nominal_rate_mhz = c.min_rate_mhz = 0; }); },
     "nominal_rate is 0; it must be above 0"},
    {"no_shape", Planar, [](Block& b) { b[kShape] = std::byte{5}; },
     "shape is 5; it must be 1 (planar stack)"},

    {"planar_short", Planar, [](Block& b) { Resize(b, kShape + sizeof(PlanarShape) - 1); },
     "length of the shape is 31; it must be 32 or more"},
    {"planar_long", Planar, [](Block& b) { Resize(b, b.size() + 1); }, "57"},
    {"planar_normal", Planar, [](Block& b) { Put<uint8_t>(b, kShape + 1, 2); },
     "normal is 2; it must be 0 (z) or 1 (y)"},
    {"planar_pitch_u", Planar, [](Block& b) { Put(b, kShape + 8, 0.0); },
     "pitch is 0; it must be above 0"},
    {"planar_pitch_v", Planar, [](Block& b) { Put(b, kShape + 16, kInfinity); },
     "pitch is inf; it must be above 0"},
    {"planar_thickness", Planar, [](Block& b) { Put(b, kShape + 24, kNaN); },
     "pitch is nan; it must be above 0"},

    {"rotor_no_panels", [] { return RotorOf(); }, [](Block& b) { Put<uint8_t>(b, kShape + 2, 0); },
     "panels is 0; it must be from 1 to 16"},
    {"rotor_many_panels", [] { return RotorOf(); },
     [](Block& b) { Put<uint8_t>(b, kShape + 2, 17); }, "panels is 17; it must be from 1 to 16"},
    {"rotor_no_slices", [] { return RotorOf(); }, [](Block& b) { Put<uint32_t>(b, kShape + 4, 0); },
     "slices_per_turn is 0; it must be slices (72) / panels (2)"},
    {"rotor_other_slices", [] { return RotorOf(); },
     [](Block& b) { Put<uint32_t>(b, kShape + 4, 37); },
     "slices_per_turn is 37; it must be slices (72) / panels (2)"},
    {"rotor_many_slices", [] { return RotorOf(); },
     [](Block& b) {
       Put<uint32_t>(b, kShape + 4, 16385);
       SetFixed(b, [](auto& c) { c.slices = 16385 * 2; });
     },
     "slices_per_turn is 16385; it must be slices (32770) / panels (2)"},
    {"rotor_long", [] { return RotorOf(); }, [](Block& b) { Resize(b, b.size() + 8); }, "128"},
    {"rotor_pitch_u", [] { return RotorOf(); }, [](Block& b) { Put(b, kPanel, -1.0); },
     "pitch is -1; it must be above 0"},
    {"rotor_pitch_v", [] { return RotorOf(); }, [](Block& b) { Put(b, kPanel + 8, kInfinity); },
     "pitch is inf"},
    {"rotor_eccentricity", [] { return RotorOf(); }, [](Block& b) { Put(b, kPanel + 16, kNaN); },
     "panel offset is nan; it must be finite"},
    {"rotor_shift_u", [] { return RotorOf(); }, [](Block& b) { Put(b, kPanel + 24, kInfinity); },
     "panel offset is inf"},
    {"rotor_shift_v", [] { return RotorOf(); }, [](Block& b) { Put(b, kPanel + 32, kNaN); },
     "panel offset is nan"},
    {"rotor_phase_one", [] { return RotorOf(); }, [](Block& b) { Put(b, kPanel + 40, 1.0); },
     "phase is 1; it must be in [0, 1)"},
    {"rotor_phase_negative", [] { return RotorOf(); }, [](Block& b) { Put(b, kPanel + 40, -0.5); },
     "phase is -0.5"},

    {"helix_slices", [] { return HelixOf(); }, [](Block& b) { Put<uint32_t>(b, kShape + 4, 91); },
     "slices_per_turn is 91; it must be 90, as many as slices"},
    {"helix_long", [] { return HelixOf(); }, [](Block& b) { Resize(b, b.size() + 1); }, "65"},

    {"lattice_short", [] { return LatticeOf(); },
     [](Block& b) { Resize(b, kShape + sizeof(LatticeShape) - 1); },
     "length of the shape is 31; it must be 32 or more"},
    {"lattice_high", [] { return LatticeOf(); },
     [](Block& b) { SetFixed(b, [](auto& c) { c.height = 2; }); },
     "height is 2; it must be 1: slices of a lattice are rows"},
    {"lattice_long", [] { return LatticeOf(); }, [](Block& b) { Resize(b, b.size() + 24); }, "104"},
    {"lattice_x", [] { return LatticeOf(); }, [](Block& b) { Put(b, kShape + 32, kNaN); }, "nan"},
    {"lattice_xy", [] { return LatticeOf(); },
     [](Block& b) {
       Put(b, kShape + 32, kNaN);
       Put(b, kShape + 40, kNaN);
     },
     "nan"},
};

TEST(CapabilitiesShapes, WhatIsWrongIsSaid) {
  for (const Wrong& wrong : kWrongs) {
    SCOPED_TRACE(wrong.name);
    Block block = EncodeCapabilities(Device(wrong.good()));
    ASSERT_TRUE(ParseCapabilities(block).ok()) << ParseCapabilities(block).status();
    wrong.spoil(block);
    const absl::Status status = ParseCapabilities(block).status();
    ASSERT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("the device's capabilities: "));
    EXPECT_THAT(std::string(status.message()), HasSubstr(wrong.message));
  }
}

TEST(CapabilitiesShapes, ALightThatIsNoneHasNoCoordinates) {
  Block block = EncodeCapabilities(Device(LatticeOf()));
  for (const size_t axis : {0u, 1u, 2u}) Put(block, kShape + 32 + 8 * axis, kNaN);
  const auto parsed = ParseCapabilities(block);
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  const auto& lattice = std::get<Lattice>(parsed->geometry.shape);
  EXPECT_EQ(lattice.points_mm[0], std::nullopt);
  EXPECT_EQ(lattice.points_mm[1], (Vec3{1, 2, 3}));
}

TEST(CapabilitiesShapes, EitherWayRoundGoesThereAndBack) {
  for (const bool clockwise : {false, true}) {
    for (const Geometry& geometry : {RotorOf(clockwise), HelixOf(clockwise)}) {
      const auto parsed = ParseCapabilities(EncodeCapabilities(Device(geometry)));
      ASSERT_TRUE(parsed.ok()) << parsed.status();
      EXPECT_EQ(parsed->geometry, geometry);
    }
  }
}

// Decoding an encoded block gives what was encoded, not what was read before.
TEST(CapabilitiesShapes, EveryFieldGoesThereAndBack) {
  const auto back = [](const Geometry& geometry) {
    const auto parsed = ParseCapabilities(EncodeCapabilities(Device(geometry)));
    EXPECT_TRUE(parsed.ok()) << parsed.status();
    return parsed.ok() ? parsed->geometry : Geometry();
  };
  for (const bool u : {false, true}) {
    for (const bool v : {false, true}) {
      Geometry planar = Planar();
      auto& stack = std::get<PlanarStack>(planar.shape);
      stack.normal = u ? PlanarStack::Normal::kY : PlanarStack::Normal::kZ;
      stack.pitch_u_mm = 0.3;
      stack.pitch_v_mm = 0.7;
      stack.mirror_u = u;
      stack.mirror_v = v;
      EXPECT_EQ(back(planar), planar);
      Geometry rotor = RotorOf();
      auto& panel = std::get<Rotor>(rotor.shape).panels[1];
      panel = {.pitch_u_mm = 1.5,
               .pitch_v_mm = 1.25,
               .eccentricity_mm = 4,
               .shift_u_mm = 5,
               .shift_v_mm = 6,
               .phase_turns = 0.75,
               .mirror_u = u,
               .mirror_v = v};
      EXPECT_EQ(back(rotor), rotor);
      Geometry helix = HelixOf(u);
      auto& blades = std::get<Helix>(helix.shape);
      blades.left_handed = v;
      blades.mirror_u = v;
      blades.mirror_v = u;
      blades.phase_turns = 0.5;
      blades.pitch_u_mm = 0.9;
      blades.pitch_v_mm = 0.8;
      EXPECT_EQ(back(helix), helix);
    }
  }
  Geometry lattice = LatticeOf(2);
  std::get<Lattice>(lattice.shape).cell_mm = {4, 5, 6};
  EXPECT_EQ(back(lattice), lattice);
  for (const size_t panels : {1u, 16u}) {
    Geometry rotor = RotorOf();
    std::get<Rotor>(rotor.shape).panels.resize(panels);
    EXPECT_EQ(back(rotor), rotor) << panels;
  }
}

FrameLayout LayoutOf(const DeviceCapabilities& device) {
  return {.slices = static_cast<int32_t>(device.fixed.slices),
          .width = static_cast<int32_t>(device.fixed.width),
          .height = static_cast<int32_t>(device.fixed.height)};
}

TEST(CapabilitiesShapes, OfACalibratedHelixOrLatticeWhatItIsMadeOfCounts) {
  const auto helix = *ParseCapabilities(EncodeCapabilities(Device(HelixOf())));
  Geometry other = HelixOf(true);
  auto& turned = std::get<Helix>(other.shape);
  turned.left_handed = turned.mirror_u = turned.mirror_v = true;
  turned.phase_turns = 0.25;
  EXPECT_FALSE(CheckCapabilities(helix, other, LayoutOf(helix)).ok());
  EXPECT_TRUE(CheckCapabilities(helix, other, LayoutOf(helix), true).ok());
  turned.hub_mm = 1;
  EXPECT_FALSE(CheckCapabilities(helix, other, LayoutOf(helix), true).ok());

  const auto lattice = *ParseCapabilities(EncodeCapabilities(Device(LatticeOf())));
  EXPECT_TRUE(CheckCapabilities(lattice, LatticeOf(), LayoutOf(lattice), true).ok());
  Geometry moved = LatticeOf();
  std::get<Lattice>(moved.shape).points_mm[0] = Vec3{9, 9, 9};
  EXPECT_FALSE(CheckCapabilities(lattice, moved, LayoutOf(lattice), true).ok());
}

TEST(CapabilitiesShapes, ABitmapFitsAPayload) {
  // With two sub-frames it has two bits a slice, after 16 bytes.
  const auto check = [](int rows) {
    DeviceCapabilities device = Device(LatticeOf(rows));
    device.fixed.max_payload = 1024;
    const auto parsed = ParseCapabilities(EncodeCapabilities(device));
    EXPECT_TRUE(parsed.ok()) << parsed.status();
    FrameLayout layout = LayoutOf(*parsed);
    layout.sub_frames = 2;
    return CheckCapabilities(*parsed, LatticeOf(rows), layout);
  };
  EXPECT_EQ(check(4032), absl::OkStatus()) << "1,008 bytes and 16";
  EXPECT_EQ(check(4033).message(),
            "a bitmap of 8066 pictures is longer than the device's 1024 bytes of payload");
}

}  // namespace capabilities_shapes_test
}  // namespace voxeld::display::voxlink
