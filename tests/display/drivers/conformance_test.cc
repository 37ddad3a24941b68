// Tests the contract of every display driver, whatever its device: to test a driver, add a line at
// the end. Runs on the real clock, with the driver's own threads.

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "display/api/pixels.h"
#include "display/drivers/registry.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/fadecandy/fadecandy_rig.h"
#include "tests/display/drivers/network/heard.h"
#include "tests/display/drivers/rig.h"

namespace voxeld::display {
namespace {

using Kind = VolumeOutcome::Kind;

absl::StatusOr<std::unique_ptr<Display>> CreateByName(const DisplayOptions& options,
                                                      sync::Clock& clock) {
  return CreateDisplay(options, clock);
}

struct DriverCase {
  std::string name;
  DisplayOptions options;
  bool predicts_sweeps = true;
  absl::StatusOr<std::unique_ptr<Display>> (*create)(const DisplayOptions&,
                                                     sync::Clock&) = &CreateByName;
};
std::ostream& operator<<(std::ostream& out, const DriverCase& c) { return out << c.name; }

// The owner's thread: ticks when it is woken or when the time has come.
class DriverConformance : public testing::TestWithParam<DriverCase> {
 protected:
  static constexpr sync::TimeNs kLimit = 20 * sync::kSecond;

  void SetUp() override {
    absl::StatusOr<std::unique_ptr<Display>> display =
        GetParam().create(GetParam().options, clock_);
    ASSERT_TRUE(display.ok()) << display.status();
    display_ = *std::move(display);
  }
  void TearDown() override {
    if (display_ != nullptr) display_->Stop();
  }

  void Start() {
    ASSERT_TRUE(display_
                    ->Start(&recorder_,
                            [this] {
                              sync::MutexLock lock(mutex_);
                              woken_ = true;
                              wake_.NotifyAll();
                            })
                    .ok());
    ASSERT_TRUE(RunUntil([&] { return display_->state() == DisplayState::kShowing; }))
        << display_->state_reason();
  }
  bool RunUntil(const std::function<bool()>& done) {
    const sync::TimeNs end = clock_.Now() + kLimit;
    while (clock_.Now() < end) {
      const sync::TimeNs next = std::min(display_->Tick(), end);
      if (done()) return true;
      sync::MutexLock lock(mutex_);
      while (!woken_ && clock_.Now() < next) clock_.WaitUntil(mutex_, wake_, next);
      woken_ = false;
    }
    return done();
  }
  bool RunUntilOutcome(uint64_t volume) {
    return RunUntil([&] { return recorder_.Of(volume) != nullptr; });
  }

  sync::SystemClock clock_;
  std::unique_ptr<Display> display_;
  Recorder recorder_;
  sync::Mutex mutex_;
  sync::CondVar wake_;
  bool woken_ VOXELD_GUARDED_BY(mutex_) = false;
};

TEST_P(DriverConformance, InfoHoldsTogether) {
  const DisplayInfo& info = display_->info();
  EXPECT_EQ(info.name, GetParam().options.name);
  EXPECT_EQ(info.driver, GetParam().options.driver);
  EXPECT_GT(info.layout.bytes(), 0u);
  EXPECT_GT(info.geometry.grid.nx, 0);
  EXPECT_GT(info.volumes_per_second, 0);
  for (const Tone::Curve& curve : info.tone.lut) EXPECT_EQ(curve[0], 0);
}

TEST_P(DriverConformance, PresentsEveryVolumeThatWaitsForItsTurn) {
  Start();
  FrameSource source(display_->info().layout, 1);
  sync::TimeNs last = 0;
  for (uint64_t volume = 1; volume <= 20; ++volume) {
    ASSERT_TRUE(display_->mailbox_free());
    const SliceFramePtr frame = source.Next(0.2);
    const sync::TimeNs submitted = clock_.Now();
    display_->Submit(frame);
    ASSERT_TRUE(RunUntilOutcome(volume));
    const VolumeOutcome& outcome = *recorder_.Of(volume);
    EXPECT_EQ(outcome.kind, Kind::kPresented) << outcome.reason;
    EXPECT_GT(outcome.time_ns, last);
    EXPECT_GE(outcome.time_ns, submitted);
    EXPECT_GE(outcome.last_byte_ns, submitted);
    EXPECT_GT(outcome.bytes_sent, 0u);
    last = outcome.time_ns;
  }
  EXPECT_EQ(recorder_.outcomes.size(), 20u);
  EXPECT_EQ(display_->stats().volumes_presented, 20u);
}

TEST_P(DriverConformance, AFloodIsThinnedOutAndCounted) {
  Start();
  FrameSource source(display_->info().layout, 2);
  for (uint64_t volume = 1; volume <= 100; ++volume) {
    display_->Submit(source.Next(0.5));
    if (volume % 7 == 0) display_->Tick();
  }
  ASSERT_TRUE(RunUntilOutcome(100));
  EXPECT_EQ(recorder_.Of(100)->kind, Kind::kPresented);
  for (uint64_t volume = 1; volume <= 100; ++volume) EXPECT_EQ(recorder_.Count(volume), 1);
  const DisplayStats& stats = display_->stats();
  EXPECT_EQ(stats.volumes_submitted, 100u);
  EXPECT_EQ(stats.volumes_presented + stats.volumes_replaced + stats.volumes_lost, 100u);
  EXPECT_EQ(stats.volumes_lost, 0u);
}

TEST_P(DriverConformance, UnchangedPicturesAreNotSentAgain) {
  Start();
  FrameSource source(display_->info().layout, 3);
  display_->Submit(source.Next(1));
  ASSERT_TRUE(RunUntilOutcome(1));
  display_->Submit(source.Next(0));
  ASSERT_TRUE(RunUntilOutcome(2));
  EXPECT_LT(recorder_.Of(2)->bytes_sent, display_->info().layout.bytes_per_slice() + 1024);
}

TEST_P(DriverConformance, CapturesWhatWasSubmitted) {
  Start();
  FrameSource source(display_->info().layout, 4);
  SliceFramePtr frame;
  for (uint64_t volume = 1; volume <= 3; ++volume) {
    frame = source.Next(0.3);
    display_->Submit(frame);
    ASSERT_TRUE(RunUntilOutcome(volume));
  }
  std::optional<absl::StatusOr<DecodedVolume>> captured;
  display_->Capture(kLimit, [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
  ASSERT_TRUE(RunUntil([&] { return captured.has_value(); }));
  ASSERT_TRUE(captured->ok()) << captured->status();
  EXPECT_EQ((*captured)->volume, 3u);
  EXPECT_EQ((*captured)->layout, display_->info().layout);
  EXPECT_EQ((*captured)->Rgb(), FrameToRgb(*frame));
  EXPECT_EQ(recorder_.outcomes.size(), 3u);
}

TEST_P(DriverConformance, WatchersSeeEveryVolumeThatIsShown) {
  Start();
  FrameSource source(display_->info().layout, 6);
  SliceFramePtr frame = source.Next(0.3);
  display_->Submit(frame);
  ASSERT_TRUE(RunUntilOutcome(1));
  std::vector<DecodedVolume> seen;
  display_->Watch([&](absl::StatusOr<DecodedVolume> volume) {
    ASSERT_TRUE(volume.ok()) << volume.status();
    seen.push_back(*std::move(volume));
  });
  ASSERT_TRUE(RunUntil([&] { return !seen.empty(); })) << "the current one, sent again";
  EXPECT_EQ(seen.back().volume, 1u);
  EXPECT_EQ(seen.back().Rgb(), FrameToRgb(*frame));
  for (uint64_t volume = 2; volume <= 6; ++volume) {
    frame = source.Next(volume % 2 == 0 ? 0.2 : 1);
    display_->Submit(frame);
    ASSERT_TRUE(RunUntil([&] { return seen.back().volume == volume; }));
    EXPECT_EQ(seen.back().Rgb(), FrameToRgb(*frame)) << volume;
    if (volume != 4) continue;
    std::optional<absl::StatusOr<DecodedVolume>> captured;  // beside the volume
    display_->Capture(kLimit, [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
    ASSERT_TRUE(RunUntil([&] { return captured.has_value(); }));
    EXPECT_EQ((*captured)->Rgb(), FrameToRgb(*frame));
  }
  display_->Unwatch();
  const size_t told = seen.size();
  display_->Submit(source.Next(1));
  ASSERT_TRUE(RunUntilOutcome(7));
  EXPECT_EQ(seen.size(), told);
}

TEST_P(DriverConformance, BlankAndBrightness) {
  Start();
  FrameSource source(display_->info().layout, 5);
  EXPECT_TRUE(display_->SetBrightness(0.5).ok());
  EXPECT_FALSE(display_->SetBrightness(2).ok());
  ASSERT_TRUE(display_->SetBlank(true).ok());
  display_->Submit(source.Next(1));
  ASSERT_TRUE(RunUntilOutcome(1));
  EXPECT_EQ(recorder_.Of(1)->kind, Kind::kLost);
  EXPECT_EQ(recorder_.Of(1)->reason, "blanked");
  ASSERT_TRUE(display_->SetBlank(false).ok());
  // A volume that meets a device which is still dark is lost.
  uint64_t volume = 1;
  do {
    display_->Submit(source.Next(1));
    ASSERT_TRUE(RunUntilOutcome(++volume));
  } while (volume < 10 && recorder_.Of(volume)->kind != Kind::kPresented);
  EXPECT_EQ(recorder_.Of(volume)->kind, Kind::kPresented) << recorder_.Of(volume)->reason;
}

TEST_P(DriverConformance, StopsAtAnyTimeAndStartsAgain) {
  for (int round = 0; round < 3; ++round) {
    recorder_.outcomes.clear();
    Start();
    FrameSource source(display_->info().layout, 6);
    display_->Submit(source.Next(1));
    ASSERT_TRUE(RunUntilOutcome(1));
    display_->Submit(source.Next(1));
    display_->Submit(source.Next(1));
    display_->Stop();
    EXPECT_EQ(display_->state(), DisplayState::kStopped);
    for (uint64_t volume = 1; volume <= 3; ++volume) EXPECT_EQ(recorder_.Count(volume), 1);
  }
}

TEST_P(DriverConformance, SweepsArePredicted) {
  Start();
  FrameSource source(display_->info().layout, 7);
  for (uint64_t volume = 1; volume <= 5; ++volume) {
    display_->Submit(source.Next(1));
    ASSERT_TRUE(RunUntilOutcome(volume));
  }
  const std::vector<sync::TimeNs> sweeps = display_->ComingSweeps(3);
  ASSERT_EQ(sweeps.size(), GetParam().predicts_sweeps ? 3u : 0u);
  if (!GetParam().predicts_sweeps) return;
  const double period = 1e9 / display_->info().volumes_per_second;
  EXPECT_NEAR(static_cast<double>(sweeps[1] - sweeps[0]), period, period / 100);
  // A busy machine may be late with some: most must be at their predicted times.
  constexpr uint64_t kVolumes = 9;
  std::vector<double> off;
  for (uint64_t volume = 5; volume < 5 + kVolumes; ++volume) {
    const std::vector<sync::TimeNs> next = display_->ComingSweeps(1);
    ASSERT_EQ(next.size(), 1u);
    const double phase = static_cast<double>(next[0] - recorder_.Of(volume)->time_ns) / period;
    off.push_back(std::abs(phase - std::round(phase)));
    display_->Submit(source.Next(1));
    ASSERT_TRUE(RunUntilOutcome(volume + 1));
  }
  std::sort(off.begin(), off.end());
  EXPECT_LE(off[kVolumes / 2], 0.25);
}

INSTANTIATE_TEST_SUITE_P(
    Drivers, DriverConformance,
    testing::Values(
        DriverCase{"SimulatedPlanar",
                   {.name = "planar", .driver = "simulated", .options = {{"size", "32x32x32"}}}},
        DriverCase{"SimulatedRotor",
                   {.name = "rotor",
                    .driver = "simulated",
                    .options = {{"geometry", "rotor"},
                                {"size", "32x16"},
                                {"slices", "60"},
                                {"eccentricity", "0.5;4"},
                                {"format", "bitplanes"},
                                {"sub_frames", "2"},
                                {"rate", "60"}}}},
        DriverCase{"SimulatedSlow",
                   {.name = "slow",
                    .driver = "simulated",
                    .options = {{"size", "32x32x16"},
                                {"pacing", "4000000"},
                                {"rate", "100"},
                                {"max_payload", "2048"},
                                {"receive_buffer", "65536"}}}},
        DriverCase{"Fadecandy",
                   {.name = "cube",
                    .driver = "fadecandy",
                    .options = {{"cube", "8x8x16"}, {"boards", "2"}, {"serpentine", "rows"}}},
                   false,
                   &fadecandy::CreateEmulated},
        DriverCase{"NetworkDdp",
                   {.name = "wall",
                    .driver = "network",
                    .options = {{"address", "127.0.0.1"}, {"cube", "12x12x12"}}},
                   true,
                   &network::CreateHeard},
        DriverCase{"NetworkE131",
                   {.name = "wall",
                    .driver = "network",
                    .options = {{"address", "127.0.0.1"},
                                {"protocol", "e131"},
                                {"sync_universe", "7"},
                                {"color_order", "grb"},
                                {"rate", "60"}}},
                   true,
                   &network::CreateHeard},
        DriverCase{"FadecandyFading",
                   {.name = "cube", .driver = "fadecandy", .options = {{"interpolate", "true"}}},
                   false,
                   &fadecandy::CreateEmulated}),
    [](const testing::TestParamInfo<DriverCase>& param) { return param.param.name; });

}  // namespace
}  // namespace voxeld::display
