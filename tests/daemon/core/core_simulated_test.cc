// Tests a whole daemon in one thread under a clock that stands still: the CPU engine, the voxlink
// driver, and the device model at the other end of its wire. The same run twice gives the same
// receipts, to the nanosecond.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "daemon/core/core.h"
#include "display/drivers/simulated/simulated.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Dots;
using testing::Entity1;
using testing::Put;
using testing::RecordingSink;
using Kind = CommitOutcome::Kind;

using Options = std::map<std::string, std::string>;

// 12 × 10 × 6 voxels of 1 mm.
class SimulatedDaemon {
 public:
  explicit SimulatedDaemon(Options options = {}, DisplaySetup voxels = {}) {
    options["size"] = "12x10x6";
    options["dither"] = "none";
    absl::StatusOr<display::simulated::Parts> parts =
        display::simulated::CreateParts({"main", "simulated", options}, clock, false);
    EXPECT_TRUE(parts.ok()) << parts.status();
    transport_ = parts->transport;
    device_ = parts->device;
    CoreOptions core_options;
    core_options.threads = false;
    core.emplace(std::move(core_options), clock);
    gpu::EngineOptions engine;
    engine.kind = gpu::EngineKind::kCpu;
    engine.threads = 1;
    engine.inline_execution = true;
    voxels.view.mode = ViewOptions::Mode::kVoxels;
    const absl::Status added = core->AddDisplay(std::move(parts->display), engine, voxels);
    EXPECT_TRUE(added.ok()) << added;
    EXPECT_TRUE(core->Start().ok());
    RunFor(sync::kSecond);
    core->OpenSession({}, 0, sink, [this](auto info) { session_ = *info; });
    RunFor(0);
  }

  // Runs everything that happens in that time, in order.
  void RunFor(sync::TimeNs span) {
    const sync::TimeNs end = clock.Now() + span;
    while (clock.Now() < end) {
      // Core and device answer each other a few times within one moment,
      // and no later than the next millisecond.
      sync::TimeNs next = clock.Now() + sync::kMillisecond;
      for (int i = 0; i < 4; ++i) next = std::min({next, core->Step(), transport_->Pump()});
      clock.AdvanceTo(std::min(end, std::max(next, clock.Now() + 1000)));
    }
    core->Step();
  }

  template <typename... Ops>
  void Send(Ops... ops) {
    std::vector<Operation> all = testing::Sequence(sequence_, std::move(ops)...);
    sequence_ += all.size();
    session_.intake->Take({std::move(all), {}, 100});
    core->Step();
  }

  std::optional<display::DecodedVolume> Seen() const { return device_->Seen(); }

  absl::StatusOr<display::DecodedVolume> Capture(uint64_t at_least) {
    absl::StatusOr<display::DecodedVolume> volume = absl::UnknownError("no answer");
    core->Capture("main", 10 * sync::kSecond, at_least, [&](auto v) { volume = std::move(v); });
    RunFor(2 * sync::kSecond);
    return volume;
  }

  sync::FakeClock clock;
  std::optional<Core> core;
  std::shared_ptr<RecordingSink> sink = std::make_shared<RecordingSink>();

 private:
  display::InProcessTransport* transport_ = nullptr;
  display::emulator::VoxlinkDevice* device_ = nullptr;
  SessionInfo session_;
  uint64_t sequence_ = 0;
};

uint32_t PixelAt(const display::DecodedVolume& volume, int u, int v, int slice) {
  const size_t at =
      ((static_cast<size_t>(slice) * volume.layout.height + v) * volume.layout.width + u) * 3;
  const std::vector<uint8_t> rgb = volume.Rgb();
  return uint32_t{rgb[at]} << 16 | uint32_t{rgb[at + 1]} << 8 | rgb[at + 2];
}

TEST(CoreSimulated, AVoxelGoesInAndItsPixelComesOut) {
  SimulatedDaemon daemon;
  daemon.Send(Put("a", "x", Entity1(Dots(0, 0x40C0FF), testing::Shift(7.5, 3.5, 4.5))),
              testing::EndCommit(1));
  daemon.RunFor(sync::kSecond);
  ASSERT_EQ(daemon.sink->OutcomesOf(1).size(), 1u);
  EXPECT_EQ(daemon.sink->OutcomesOf(1)[0].kind, Kind::kPresented);
  const auto volume = daemon.Capture(1);
  ASSERT_TRUE(volume.ok()) << volume.status();
  int lit = 0;
  for (int slice = 0; slice < 6; ++slice) {
    for (int v = 0; v < 10; ++v) {
      for (int u = 0; u < 12; ++u) lit += PixelAt(*volume, u, v, slice) != 0;
    }
  }
  EXPECT_EQ(lit, 1);
  EXPECT_EQ(PixelAt(*volume, 7, 3, 4), 0x40C0FFu);
}

absl::StatusOr<DisplayDescription> Update(SimulatedDaemon& daemon, DisplayUpdate update) {
  absl::StatusOr<DisplayDescription> result = absl::UnknownError("no answer");
  daemon.core->UpdateDisplay("main", std::move(update), [&](auto r) { result = std::move(r); });
  daemon.RunFor(sync::kSecond);
  return result;
}

DisplayFigures FiguresOf(SimulatedDaemon& daemon) {
  DisplayFigures figures;
  daemon.core->GetStats([&](absl::StatusOr<Stats> s) { figures = s->displays[0]; });
  daemon.RunFor(0);
  return figures;
}

double LightOf(const display::DecodedVolume& volume) {
  double sum = 0;
  for (const uint8_t b : volume.Rgb()) sum += b;
  return sum / 255 / static_cast<double>(volume.Rgb().size());
}

TEST(CoreSimulated, ADeviceWithoutBrightnessIsDimmedInSteps) {
  SimulatedDaemon daemon(Options{{"device_brightness", "false"}});
  daemon.Send(Put("a", "x", Entity1(Dots(0, 0xFFFFFF), testing::Shift(7.5, 3.5, 4.5))),
              testing::EndCommit(1));
  for (const auto& [brightness, level] :
       {std::pair(0.5, 127), std::pair(0.001, 3), std::pair(0.0, 0), std::pair(1.0, 255)}) {
    const auto updated = Update(daemon, {.brightness = brightness});
    ASSERT_TRUE(updated.ok()) << updated.status();
    EXPECT_EQ(updated->brightness, brightness);
    const auto volume = daemon.Capture(1);
    ASSERT_TRUE(volume.ok()) << volume.status();
    EXPECT_NEAR(PixelAt(*volume, 7, 3, 4) & 255, level, 1) << brightness;
  }
}

TEST(CoreSimulated, ADeviceWithoutAPowerLimitIsKeptBelowItByItsLight) {
  DisplaySetup setup;
  setup.power_full_w = 100;
  setup.power_limit_w = 20;
  SimulatedDaemon daemon(Options{{"device_power_limit", "false"}}, setup);
  double most = 0;
  const auto watch = [&] {
    for (int i = 0; i < 60; ++i) {
      daemon.RunFor(50 * sync::kMillisecond);
      if (const auto seen = daemon.Seen(); seen.has_value()) most = std::max(most, LightOf(*seen));
    }
  };
  ASSERT_TRUE(Update(daemon, {.pattern = TestPattern::kWhite}).ok());
  watch();
  EXPECT_GT(LightOf(*daemon.Seen()), 0.17);
  EXPECT_LT(FiguresOf(daemon).light, 0.21);
  EXPECT_NEAR(FiguresOf(daemon).power_w, 100 * LightOf(*daemon.Seen()), 0.5);
  // A dim scene has all its light again.
  ASSERT_TRUE(Update(daemon, {.pattern = TestPattern::kAxes}).ok());
  watch();
  EXPECT_EQ(FiguresOf(daemon).light, 1);
  ASSERT_TRUE(Update(daemon, {.pattern = TestPattern::kWhite}).ok());
  watch();
  EXPECT_LE(most, 0.2) << "of 100 W";
  // Another limit, and none.
  ASSERT_TRUE(Update(daemon, {.power_limit_w = 50}).ok());
  watch();
  EXPECT_GT(LightOf(*daemon.Seen()), 0.4);
  EXPECT_LE(most, 0.5);
  ASSERT_TRUE(Update(daemon, {.power_limit_w = 0}).ok());
  daemon.RunFor(sync::kSecond);
  EXPECT_EQ(LightOf(*daemon.Seen()), 1);
}

TEST(CoreSimulated, ALimitThatNobodyKeepsIsRefusedOrTold) {
  SimulatedDaemon daemon(Options{{"device_power_limit", "false"}});
  const auto refused = Update(daemon, {.brightness = 0.5, .power_limit_w = 20});
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(refused.status().message(), ::testing::HasSubstr("power_full"));
  EXPECT_EQ(Update(daemon, {})->brightness, 1) << "all or nothing";
  DisplaySetup setup;
  setup.power_limit_w = 20;
  SimulatedDaemon told(Options{{"device_power_limit", "false"}}, setup);
  told.RunFor(sync::kSecond);
  EXPECT_TRUE(FiguresOf(told).power_unlimited);
  SimulatedDaemon kept(Options{}, setup);
  kept.RunFor(sync::kSecond);
  EXPECT_FALSE(FiguresOf(kept).power_unlimited);
}

TEST(CoreSimulated, AnInstanceAFrameAndALayersStateAreSeen) {
  SimulatedDaemon daemon;
  daemon.Send(testing::Define("o", {{Dots(0.5f, 0xFF0000), testing::Shift(0, 0.5, 0.5)}}),
              testing::PutInstance("a", "1", "o", testing::Shift(2, 0, 0)),
              testing::PutInstance("a", "2", "o", testing::Shift(0, 5, 0)),
              testing::SetLayer("a", true, testing::Shift(1, 1, 1)), testing::Begin("b"),
              Put("b", "x", Entity1(Dots(0, 0x00FF00), testing::Shift(0.5, 0.5, 0.5))),
              testing::End("b"), testing::EndCommit(1));
  const auto volume = daemon.Capture(1);
  ASSERT_TRUE(volume.ok()) << volume.status();
  EXPECT_EQ(PixelAt(*volume, 3, 1, 1), 0xFF0000u);
  EXPECT_EQ(PixelAt(*volume, 1, 6, 1), 0xFF0000u);
  EXPECT_EQ(PixelAt(*volume, 0, 0, 0), 0x00FF00u);
  daemon.Send(testing::SetLayer("a", false), testing::EndCommit(2));
  const auto hidden = daemon.Capture(2);
  ASSERT_TRUE(hidden.ok()) << hidden.status();
  EXPECT_EQ(PixelAt(*hidden, 3, 1, 1), 0u);
  EXPECT_EQ(PixelAt(*hidden, 0, 0, 0), 0x00FF00u);
}

TEST(CoreSimulated, OnlyWhatLiesWithinAClipAndARegionIsSeen) {
  SimulatedDaemon daemon;
  daemon.Send(Put("a", "1", Entity1(Dots(0, 0xFF0000), testing::Shift(2.5, 3.5, 1.5))),
              Put("a", "2", Entity1(Dots(0, 0x00FF00), testing::Shift(8.5, 3.5, 1.5))),
              Put("b", "3", Entity1(Dots(0, 0x0000FF), testing::Shift(2.5, 7.5, 1.5))),
              testing::SetClip("a", {{1, 0, 0, -5}}), testing::EndCommit(1));
  const auto clipped = daemon.Capture(1);
  ASSERT_TRUE(clipped.ok()) << clipped.status();
  EXPECT_EQ(PixelAt(*clipped, 2, 3, 1), 0u);
  EXPECT_EQ(PixelAt(*clipped, 8, 3, 1), 0x00FF00u);
  EXPECT_EQ(PixelAt(*clipped, 2, 7, 1), 0x0000FFu);  // another layer's
  daemon.Send(testing::SetClip("a", {}), testing::SetRegion("a", gpu::Region{{0, 0, 0}, {5, 5, 5}}),
              testing::EndCommit(2));
  const auto region = daemon.Capture(2);
  ASSERT_TRUE(region.ok()) << region.status();
  EXPECT_EQ(PixelAt(*region, 2, 3, 1), 0xFF0000u);
  EXPECT_EQ(PixelAt(*region, 8, 3, 1), 0u);
  daemon.Send(testing::SetRegion("a", std::nullopt), testing::EndCommit(3));
  const auto whole = daemon.Capture(3);
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_EQ(PixelAt(*whole, 2, 3, 1), 0xFF0000u);
  EXPECT_EQ(PixelAt(*whole, 8, 3, 1), 0x00FF00u);
}

std::string Describe(const Receipt& receipt) {
  if (const auto* a = std::get_if<Accepted>(&receipt.what)) {
    return absl::StrCat(receipt.frame_id, " accepted ", a->snapshot, " at ", a->applied_time_ns);
  }
  const auto& o = std::get<CommitOutcome>(receipt.what);
  return absl::StrCat(receipt.frame_id, " outcome ", static_cast<int>(o.kind), " volume ", o.volume,
                      " at ", o.time_ns, " by ", o.by_frame_id, " last byte ", o.last_byte_ns);
}

std::vector<std::string> RandomRun(uint32_t seed) {
  std::mt19937 random(seed);
  const std::map<std::string, std::string> slow = {{"pacing", "200000"}};  // bytes a second
  SimulatedDaemon daemon(slow);
  uint64_t frames = 0;
  for (int i = 0; i < 60; ++i) {
    const auto at = [&](uint32_t n) { return static_cast<double>(random() % n) + 0.5; };
    const double x = at(12), y = at(10), z = at(6);
    daemon.Send(Put("a", absl::StrCat(random() % 4), Entity1(Dots(0), testing::Shift(x, y, z))),
                testing::EndCommit(++frames));
    daemon.RunFor(static_cast<sync::TimeNs>(random() % 50) * sync::kMillisecond);
  }
  daemon.RunFor(5 * sync::kSecond);
  std::vector<std::string> told;
  for (const Receipt& receipt : daemon.sink->receipts) told.push_back(Describe(receipt));
  for (uint64_t frame = 1; frame <= frames; ++frame) {
    EXPECT_EQ(daemon.sink->OutcomesOf(frame).size(), 1u) << frame;
    for (const CommitOutcome& outcome : daemon.sink->OutcomesOf(frame)) {
      EXPECT_NE(outcome.kind, Kind::kLost) << outcome.reason;
    }
  }
  EXPECT_TRUE(daemon.core->Stop(sync::kSecond).ok());
  return told;
}

TEST(CoreSimulated, TheSameRunTwiceGivesTheSameReceipts) {
  for (uint32_t seed = 1; seed <= 3; ++seed) EXPECT_EQ(RandomRun(seed), RandomRun(seed));
}

}  // namespace
}  // namespace voxeld::daemon
