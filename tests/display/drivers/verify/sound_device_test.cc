// Runs the suites on devices that do everything right: every case passes, whatever the seed, the
// speed, the geometry and the formats, and leaves the device stopped and dark.
#include <string>

#include "display/drivers/fadecandy/verify/suite.h"
#include "display/drivers/voxlink/verify/suite.h"
#include "display/emulator/fadecandy_device.h"
#include "display/emulator/voxlink_device.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/verify/pump_waiter.h"

namespace voxeld::display::conformance {
namespace {

using emulator::VoxlinkDevice;
using emulator::VoxlinkDeviceConfig;

Geometry Planar(int32_t width, int32_t height, int32_t slices) {
  PlanarStack planar;
  planar.width_px = width;
  planar.height_px = height;
  for (int32_t i = 0; i < slices; ++i) planar.positions_mm.push_back(i);
  return {.shape = planar, .grid = {}};
}

Geometry TwoPanels() {
  Rotor rotor;
  rotor.width_px = 9;
  rotor.height_px = 7;
  rotor.slices_per_turn = 80;
  rotor.panels.resize(2);
  rotor.panels[1].phase_turns = 0.5;
  return {.shape = rotor, .grid = {}};
}

struct Sound {
  std::string name;
  VoxlinkDeviceConfig config;
  int runs = 100;
};
std::ostream& operator<<(std::ostream& out, const Sound& sound) { return out << sound.name; }

VoxlinkDeviceConfig Config(Geometry geometry, UsbSpeed speed, bool paced) {
  VoxlinkDeviceConfig config;
  config.geometry = std::move(geometry);
  config.speed = speed;
  config.bytes_per_second = paced ? BulkBytesPerSecond(speed) : 0;
  config.receive_buffer = 32768;
  config.max_payload = 4096;
  return config;
}

std::vector<Sound> SoundDevices() {
  std::vector<Sound> devices;
  for (const auto& [speed, name] : {std::pair{UsbSpeed::kFull, "Full"},
                                    {UsbSpeed::kHigh, "High"},
                                    {UsbSpeed::kSuper, "Super"}}) {
    devices.push_back({std::string("Planar") + name, Config(Planar(16, 12, 20), speed, true), 100});
    devices.push_back({std::string("Rotor") + name, Config(TwoPanels(), speed, true), 100});
  }
  devices.push_back({"AtOnce", Config(Planar(5, 4, 6), UsbSpeed::kHigh, false), 100});
  for (uint8_t format = 0; format < 3; ++format) {
    VoxlinkDeviceConfig config = Config(Planar(11, 3, 9), UsbSpeed::kHigh, true);
    config.formats = static_cast<uint8_t>(1 << format);
    devices.push_back({"OnlyFormat" + std::to_string(format), config, 10});
  }
  VoxlinkDeviceConfig config = Config(Planar(1, 1, 1), UsbSpeed::kFull, true);
  config.max_sub_frames = 1;
  devices.push_back({"OnePixel", config, 10});
  config = Config(Planar(8, 8, 8), UsbSpeed::kSuper, true);
  config.watchdog = false;
  devices.push_back({"NoWatchdog", config, 10});
  config = Config(Planar(8, 8, 8), UsbSpeed::kHigh, true);
  config.volumes_per_second = 400;
  devices.push_back({"FastSweeps", config, 3});
  config.volumes_per_second = 0.7;
  devices.push_back({"SlowSweeps", config, 3});
  // A capability block of several pages.
  config = Config(Planar(2, 2, 1500), UsbSpeed::kHigh, true);
  config.max_payload = 16384;
  config.receive_buffer = 131072;
  devices.push_back({"ManySlices", config, 2});
  return devices;
}

class SoundVoxlink : public testing::TestWithParam<Sound> {};

TEST_P(SoundVoxlink, PassesEveryCase) {
  for (int seed = 1; seed <= GetParam().runs; ++seed) {
    sync::FakeClock clock;
    auto owned = std::make_unique<VoxlinkDevice>(GetParam().config, clock);
    const VoxlinkDevice* const device = owned.get();
    Rig rig(std::move(owned), clock, voxlink::MakeSuite(nullptr));
    const absl::StatusOr<RunResult> run = rig.Run({.seed = static_cast<uint64_t>(seed)});
    ASSERT_TRUE(run.ok()) << run.status();
    ASSERT_EQ(FailedIds(*run), std::set<std::string>()) << "seed " << seed << Failures(*run);
    EXPECT_GT(run->Count(Verdict::Kind::kPassed), 60u);
    EXPECT_FALSE(device->screen().running());
    EXPECT_EQ(device->credit_excess(), 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Verify, SoundVoxlink, testing::ValuesIn(SoundDevices()),
                         [](const auto& info) { return info.param.name; });

TEST(SoundFadecandy, PassesEveryCase) {
  for (int seed = 1; seed <= 20; ++seed) {
    sync::FakeClock clock;
    auto owned =
        std::make_unique<emulator::FadecandyDevice>(emulator::FadecandyDeviceConfig{}, clock);
    const emulator::FadecandyDevice* const device = owned.get();
    Rig rig(std::move(owned), clock, fadecandy::MakeSuite());
    const absl::StatusOr<RunResult> run = rig.Run({.seed = static_cast<uint64_t>(seed)});
    ASSERT_TRUE(run.ok()) << run.status();
    ASSERT_EQ(FailedIds(*run), std::set<std::string>()) << Failures(*run);
    EXPECT_EQ(run->Count(Verdict::Kind::kPassed), run->results.size());
    clock.Advance(20 * sync::kMillisecond);
    rig.transport().Pump();
    for (const uint8_t value : device->Output()) ASSERT_EQ(value, 0);
  }
}

}  // namespace
}  // namespace voxeld::display::conformance
