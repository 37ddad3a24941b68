// Runs the suites on devices that answer with anything at all, and on ones that disappear: every
// run ends, in bounded time, with verdicts.
#include <memory>
#include <random>

#include "display/drivers/fadecandy/verify/suite.h"
#include "display/drivers/voxlink/verify/suite.h"
#include "display/emulator/fadecandy_device.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/verify/defective_device.h"
#include "tests/display/drivers/verify/pump_waiter.h"

namespace voxeld::display::conformance {
namespace {

emulator::VoxlinkDeviceConfig SmallConfig() {
  PlanarStack planar;
  planar.width_px = 4;
  planar.height_px = 3;
  planar.positions_mm = {0, 1, 2, 3};
  emulator::VoxlinkDeviceConfig config;
  config.geometry.shape = planar;
  config.receive_buffer = 16384;
  config.max_payload = 2048;
  return config;
}

// Changes some bytes of the data that is read, and its length.
Defect Garbage(uint32_t seed, uint32_t one_in) {
  const auto random = std::make_shared<std::minstd_rand>(seed);
  const auto spoil = [random, one_in](Bytes& data) {
    if ((*random)() % one_in != 0) return;
    if ((*random)() % 4 == 0) data.resize((*random)() % 65);
    for (std::byte& byte : data) {
      if ((*random)() % 8 == 0) byte = static_cast<std::byte>((*random)());
    }
  };
  return {.answer =
              [random, spoil](const UsbSetup&, TransferStatus& status, Bytes& data) {
                if ((*random)() % 16 == 0) status = static_cast<TransferStatus>((*random)() % 7);
                spoil(data);
              },
          .event =
              [random, spoil](Bytes& event) {
                spoil(event);
                return (*random)() % 16 != 0;
              },
          .bulk_end =
              [random](size_t, TransferStatus& status) {
                if ((*random)() % 32 == 0) status = static_cast<TransferStatus>((*random)() % 7);
              }};
}

TEST(HostileDevice, EveryRunOfVoxlinkEnds) {
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    sync::FakeClock clock;
    Rig rig(std::make_unique<DefectiveDevice>(
                std::make_unique<emulator::VoxlinkDevice>(SmallConfig(), clock),
                Garbage(seed, 1 + seed % 20)),
            clock, voxlink::MakeSuite(nullptr));
    const absl::StatusOr<RunResult> run = rig.Run();
    ASSERT_TRUE(run.ok()) << run.status();
    EXPECT_GT(run->Count(Verdict::Kind::kFailed), 0u) << seed;
    for (const CaseResult& result : run->results) {
      EXPECT_LT(result.duration, 120 * sync::kSecond) << result.what->id;
    }
  }
}

TEST(HostileDevice, EveryRunOfFadecandyEnds) {
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    sync::FakeClock clock;
    Rig rig(std::make_unique<DefectiveDevice>(std::make_unique<emulator::FadecandyDevice>(
                                                  emulator::FadecandyDeviceConfig{}, clock),
                                              Garbage(seed, 1 + seed % 5)),
            clock, fadecandy::MakeSuite());
    const absl::StatusOr<RunResult> run = rig.Run();
    ASSERT_TRUE(run.ok()) << run.status();
    EXPECT_GT(run->Count(Verdict::Kind::kFailed), 0u) << seed;
  }
}

// Unplugged for a while in the middle of the run: the case fails, and the ones after it find the
// device.
TEST(HostileDevice, ComesBackAfterAnUnplug) {
  sync::FakeClock clock;
  auto faults = std::make_unique<emulator::FaultInjector>(
      std::make_unique<emulator::VoxlinkDevice>(SmallConfig(), clock),
      *emulator::ParseFaultPlan("unplug:1000@2000ms"), clock);
  Rig rig(std::move(faults), clock, voxlink::MakeSuite(nullptr));
  const absl::StatusOr<RunResult> run = rig.Run();
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_EQ(run->Count(Verdict::Kind::kFailed), 1u) << Failures(*run);
}

TEST(HostileDevice, GoneForGood) {
  sync::FakeClock clock;
  auto faults = std::make_unique<emulator::FaultInjector>(
      std::make_unique<emulator::VoxlinkDevice>(SmallConfig(), clock),
      *emulator::ParseFaultPlan("unplug:1000000@2000ms"), clock);
  Rig rig(std::move(faults), clock, voxlink::MakeSuite(nullptr));
  const absl::StatusOr<RunResult> run = rig.Run();
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_GT(run->Count(Verdict::Kind::kFailed), 20u);
  const absl::StatusOr<RunResult> another = rig.Run();
  EXPECT_EQ(another.status().code(), absl::StatusCode::kNotFound);
}

TEST(HostileDevice, AnInterruptEndsTheRunAndStopsTheDevice) {
  sync::FakeClock clock;
  auto owned = std::make_unique<emulator::VoxlinkDevice>(SmallConfig(), clock);
  const emulator::VoxlinkDevice* const device = owned.get();
  Rig rig(std::move(owned), clock, voxlink::MakeSuite(nullptr));
  bool health = false, interrupted = false;
  const absl::StatusOr<RunResult> run =
      rig.Run({.on_begin = [&](const Case& what) { health = what.id == "events.health"; },
               .cancelled = [&] { return interrupted |= health && device->screen().running(); }});
  EXPECT_EQ(run.status().code(), absl::StatusCode::kCancelled);
  EXPECT_FALSE(device->screen().running());
}

}  // namespace
}  // namespace voxeld::display::conformance
