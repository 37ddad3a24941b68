// Tests the voxlink driver with its device at the other end of an in-process cable, in one thread,
// on a fake clock.

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "display/api/pixels.h"
#include "display/drivers/voxlink/voxlink_display.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/driver_fixture.h"

namespace voxeld::display {
namespace {

using emulator::Fault;
using sync::kMillisecond;
using sync::kSecond;
using Kind = VolumeOutcome::Kind;

TEST_F(Driver, AttachesAndShowsAVolume) {
  Start();
  frame_ = source_->Next(1);
  rig_->display().Submit(frame_);
  EXPECT_FALSE(rig_->device().Seen().has_value());
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  EXPECT_EQ(Newest().kind, Kind::kPresented) << Newest().reason;
  EXPECT_EQ(Newest().evidence, Evidence::kDevice);
  EXPECT_EQ(Newest().time_ns, rig_->clock().Now());
  EXPECT_GT(Newest().last_byte_ns, 0);
  EXPECT_LE(Newest().last_byte_ns, Newest().time_ns);
  // BEGIN, 6 slices, END.
  EXPECT_EQ(Newest().bytes_sent, 56u + 6 * (40 + 192) + 40);
  EXPECT_TRUE(SeesFrame());
  EXPECT_EQ(rig_->display().stats().attaches, 1u);
}

TEST_F(Driver, AnAttachedDeviceStaysDarkUntilThereIsTheNewestVolume) {
  Start();
  Show();
  rig_->recorder().has_newer = true;
  for (const bool same : {false, true}) {
    rig_->SetPlugged(false);
    rig_->RunFor(10 * kMillisecond);
    EXPECT_EQ(rig_->display().state(), DisplayState::kLost);
    rig_->SetPlugged(true);
    rig_->RunFor(2 * kSecond);
    EXPECT_EQ(rig_->display().state(), DisplayState::kShowing);
    EXPECT_FALSE(rig_->device().Seen().has_value());
    if (same) {
      rig_->display().ShowCurrent();
      EXPECT_TRUE(rig_->RunUntil([&] { return SeesFrame(); }, kSecond));
    } else {
      Show();
    }
  }
}

TEST_F(Driver, BlankAndBrightnessSetWhileTheDeviceIsSetUpHold) {
  Start();
  Show();
  for (const bool blank : {true, false}) {
    rig_->SetPlugged(false);
    rig_->RunFor(10 * kMillisecond);
    rig_->faults().Add(
        {.endpoint = 0x82, .what = emulator::Fault::What::kNak, .amount = 400 * kMillisecond});
    rig_->SetPlugged(true);
    rig_->RunFor(150 * kMillisecond);
    ASSERT_EQ(rig_->display().state(), DisplayState::kLost);  // READY is on its way
    ASSERT_TRUE(rig_->display().SetBlank(blank).ok());
    ASSERT_TRUE(rig_->display().SetBrightness(blank ? 0.25 : 0.5).ok());
    rig_->RunFor(3 * kSecond);
    EXPECT_EQ(rig_->display().state(), blank ? DisplayState::kBlanked : DisplayState::kShowing);
    EXPECT_EQ(SeesFrame(), !blank);
    EXPECT_NEAR(rig_->device().brightness(), blank ? 0.25 : 0.5, 1e-4);
  }
}

TEST_F(Driver, OnePictureInAHundredCostsATwentiethAtMost) {
  Start({{"size", "64x64x100"}});
  Show();
  const uint64_t whole = Newest().bytes_sent;
  EXPECT_EQ(whole, 56u + 100 * (40 + 12288) + 40);
  Show(1e-9);  // a single picture
  EXPECT_EQ(Newest().bytes_sent, 56u + 13 + (40 + 12288) + 40);
  EXPECT_GE(whole, 20 * Newest().bytes_sent);
}

TEST_F(Driver, SendsOnlyWhatChanged) {
  Start();
  Show();
  SliceFrame next = *frame_;
  next.volume = 2;
  next.changed_in[4] = 2;
  next.bytes[4 * 192] ^= std::byte{0xFF};
  frame_ = std::make_shared<SliceFrame>(next);
  rig_->display().Submit(frame_);
  ASSERT_TRUE(rig_->RunUntilOutcome(2));
  EXPECT_EQ(Newest().bytes_sent, 57u + 1 * (40 + 192) + 40);
  EXPECT_TRUE(SeesFrame());
  // A volume that was replaced before it was sent: its changes are sent with the next one.
  next.volume = 3;
  next.changed_in[0] = 3;
  next.bytes[0] ^= std::byte{0xFF};
  rig_->display().Submit(std::make_shared<SliceFrame>(next));
  next.volume = 4;
  next.changed_in[1] = 4;
  next.bytes[192] ^= std::byte{0xFF};
  rig_->display().Submit(std::make_shared<SliceFrame>(next));
  next.volume = 5;
  frame_ = std::make_shared<SliceFrame>(next);
  rig_->display().Submit(frame_);
  ASSERT_TRUE(rig_->RunUntilOutcome(5));
  EXPECT_EQ(rig_->recorder().Of(4)->kind, Kind::kReplaced);
  EXPECT_EQ(Newest().bytes_sent, 57u + 1 * (40 + 192) + 40);
  EXPECT_TRUE(SeesFrame());
}

TEST_F(Driver, ShowsAVolumeEverySweep) {
  Start();
  for (int i = 0; i < 30; ++i) Show(0.2);
  // 30 volumes at 30 a second, and the wait for the first sweep.
  EXPECT_LE(rig_->device().screen().shown_sweep(), 31u);
  EXPECT_EQ(rig_->display().stats().underruns, 0u);
  EXPECT_EQ(rig_->device().screen().errors(), 0u);
}

TEST_F(Driver, KeepsTheLightOnWhileNothingIsSent) {
  Start();
  Show();
  int dark = 0;
  rig_->SetObserver([&] { dark += rig_->device().screen().lit() ? 0 : 1; });
  rig_->RunFor(10 * kSecond);
  EXPECT_EQ(dark, 0);
  EXPECT_EQ(rig_->device().screen().errors(), 0u);
}

TEST_F(Driver, ASilentHostIsDarkAfterAQuarterSecond) {
  Start();
  Show();
  // The owner's thread hangs: nothing ticks the driver, and the device goes on.
  const sync::TimeNs begin = rig_->clock().Now();
  while (rig_->device().screen().lit() && rig_->clock().Now() < begin + kSecond) {
    rig_->clock().Advance(kMillisecond);
    rig_->transport().Pump();
  }
  EXPECT_GE(rig_->clock().Now() - begin, 250 * kMillisecond - 100 * kMillisecond);
  EXPECT_LE(rig_->clock().Now() - begin, 250 * kMillisecond);
  rig_->Settle();
  EXPECT_TRUE(SeesFrame());  // and lit again as soon as it returns
}

TEST_F(Driver, ComesBackAfterUnplugWithTheCurrentFrame) {
  Start();
  Show();
  Show(0.3);
  const SliceFramePtr shown = frame_;
  rig_->SetPlugged(false);
  rig_->Settle();
  EXPECT_EQ(rig_->display().state(), DisplayState::kLost);
  EXPECT_EQ(rig_->display().state_reason(), "the device was unplugged");
  const SliceFramePtr waiting = source_->Next(0.3);
  rig_->RunFor(20 * kSecond);
  EXPECT_EQ(rig_->display().state(), DisplayState::kLost);
  rig_->SetPlugged(true);
  ASSERT_TRUE(rig_->RunUntil([&] { return rig_->device().screen().lit(); }, 6 * kSecond));
  EXPECT_TRUE(SeesFrame());
  EXPECT_EQ(rig_->recorder().outcomes.size(), 2u);
  EXPECT_EQ(rig_->display().stats().attaches, 2u);
  frame_ = waiting;
  rig_->display().Submit(waiting);
  ASSERT_TRUE(rig_->RunUntilOutcome(3));
  EXPECT_TRUE(SeesFrame());
}

TEST_F(Driver, WaitsForADeviceThatIsNotThereYet) {
  Make();
  rig_->SetPlugged(false);
  rig_->Start();
  EXPECT_EQ(rig_->display().state(), DisplayState::kAttaching);
  frame_ = source_->Next(1);
  rig_->display().Submit(frame_);
  rig_->RunFor(3 * kSecond);
  EXPECT_TRUE(rig_->recorder().outcomes.empty());
  rig_->SetPlugged(true);
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  EXPECT_TRUE(SeesFrame());
}

TEST_F(Driver, BacksOffFromADeviceThatKeepsFailing) {
  Start();
  // Every transfer fails: the link gives up, attaches again, gives up again.
  rig_->transport().WithDevice([&](UsbDeviceModel&) {
    rig_->faults().Add(
        {.when = Fault::When::kTime, .at = 0, .what = Fault::What::kError, .amount = 1'000'000});
  });
  frame_ = source_->Next(1);
  rig_->display().Submit(frame_);
  rig_->RunFor(60 * kSecond);
  EXPECT_EQ(rig_->display().state_reason(), "transfers failed 6 times in a row");
  const uint64_t attaches = rig_->display().stats().attaches;
  EXPECT_GT(attaches, 10u);
  EXPECT_LT(attaches, 25u);  // 0.1 s, 0.2 s, … 3.2 s, then every 5 s
  EXPECT_EQ(Newest().kind, Kind::kLost);
  EXPECT_EQ(rig_->recorder().Count(1), 1);
}

TEST_F(Driver, ResendsMissingSlices) {
  Start();
  Show();
  rig_->faults().Add(
      {.when = Fault::When::kTime, .at = 0, .what = Fault::What::kDrop, .amount = 250});
  Show();
  EXPECT_GT(rig_->display().stats().slices_resent, 0u);
  EXPECT_GT(Newest().bytes_sent, rig_->recorder().Of(1)->bytes_sent);
  EXPECT_EQ(rig_->display().state(), DisplayState::kShowing);
}

TEST_F(Driver, AbortsAfterSoManyRoundsAndTriesAgainLater) {
  // The first volume is transfer 1; of the second, the only slice is hit each time that it is sent.
  Start({{"size", "8x8x1"},
         {"faults", "corrupt:110@t2;corrupt:60@t3;corrupt:60@t4;corrupt:60@t5;corrupt:60@t6"}});
  Show();
  const SliceFramePtr before = frame_;
  frame_ = source_->Next(1);
  rig_->display().Submit(frame_);
  ASSERT_TRUE(rig_->RunUntilOutcome(2));
  EXPECT_EQ(Newest().kind, Kind::kLost);
  EXPECT_EQ(Newest().reason, "slices did not arrive, though they were sent 4 times again");
  EXPECT_EQ(rig_->device().Seen()->Rgb(), FrameToRgb(*before));
  ASSERT_TRUE(rig_->RunUntil([&] { return SeesFrame(); }));
  EXPECT_EQ(rig_->recorder().Count(2), 1);
}

TEST_F(Driver, SurvivesStallsErrorsAndPartialTransfers) {
  Start();
  Show();
  EXPECT_EQ(rig_->display().stats().transfers_failed, 0u);
  for (const auto& [what, amount] : {std::pair{Fault::What::kStall, 0},
                                     {Fault::What::kError, 3},
                                     {Fault::What::kPartial, 100},
                                     {Fault::What::kNak, 100'000'000},
                                     {Fault::What::kDelay, 100'000'000}}) {
    for (const uint8_t endpoint : {uint8_t{0x01}, uint8_t{0x82}}) {
      rig_->faults().Add({.when = Fault::When::kTime,
                          .at = 0,
                          .endpoint = endpoint,
                          .what = what,
                          .amount = static_cast<uint64_t>(amount)});
      Show(0.5);
    }
  }
  EXPECT_EQ(rig_->display().stats().attaches, 1u);
  EXPECT_EQ(rig_->display().stats().volumes_lost, 0u);
  // A stall, three errors and a partial transfer of each endpoint; slow transfers are not failures.
  EXPECT_GE(rig_->display().stats().transfers_failed, 2u * (1 + 1 + 1));
}

TEST_F(Driver, KeepsWithinTheCredit) {
  Start({{"size", "64x64x16"},
         {"receive_buffer", "65536"},
         {"max_payload", "8192"},
         {"pacing", "1000000"}});
  size_t most = 0;
  rig_->SetObserver([&] { most = std::max(most, rig_->transport().bytes_in_flight()); });
  Show();
  EXPECT_EQ(rig_->device().credit_excess(), 0u);
  EXPECT_LE(most, 65536u + 8 * 64 + 1024);
  // 196,608 bytes at a megabyte a second.
  EXPECT_GT(rig_->clock().Now() - kSecond, 190 * kMillisecond);
  EXPECT_LT(rig_->clock().Now() - kSecond, 300 * kMillisecond);
}

TEST_F(Driver, CapturesWhatTheDeviceShows) {
  Start();
  Show();
  std::optional<absl::StatusOr<DecodedVolume>> captured;
  rig_->display().Capture(kSecond,
                          [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
  ASSERT_TRUE(rig_->RunUntil([&] { return captured.has_value(); }));
  ASSERT_TRUE(captured->ok()) << captured->status().message();
  EXPECT_EQ((*captured)->volume, 1u);
  EXPECT_EQ((*captured)->source, DecodedVolume::Source::kDecodedFromSent);
  EXPECT_EQ((*captured)->Rgb(), rig_->device().Seen()->Rgb());
  EXPECT_EQ(rig_->recorder().outcomes.size(), 1u);
}

TEST_F(Driver, CaptureSurvivesResends) {
  Start();
  Show();
  rig_->faults().Add(
      {.when = Fault::When::kTime, .at = 0, .what = Fault::What::kDrop, .amount = 250});
  frame_ = source_->Next(1);
  std::optional<absl::StatusOr<DecodedVolume>> captured;
  rig_->display().Capture(kSecond,
                          [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
  ASSERT_TRUE(rig_->RunUntil([&] { return captured.has_value(); }));
  ASSERT_TRUE(captured->ok()) << captured->status();
  EXPECT_GT(rig_->display().stats().slices_resent, 0u);
  EXPECT_EQ((*captured)->Rgb(), rig_->device().Seen()->Rgb());
}

TEST_F(Driver, BrightnessAndBlankReachTheDeviceAlsoAfterAttach) {
  Make();
  ASSERT_TRUE(rig_->display().SetBrightness(0.5).ok());
  rig_->Start();
  EXPECT_NEAR(rig_->device().brightness(), 0.5, 1e-4);
  Show();
  ASSERT_TRUE(rig_->display().SetBrightness(0.25).ok());
  ASSERT_TRUE(rig_->display().SetBlank(true).ok());
  rig_->Settle();
  EXPECT_NEAR(rig_->device().brightness(), 0.25, 1e-4);
  EXPECT_FALSE(rig_->device().Seen().has_value());
  rig_->SetPlugged(false);
  rig_->RunFor(kSecond);
  rig_->SetPlugged(true);
  rig_->RunFor(6 * kSecond);
  EXPECT_EQ(rig_->display().state(), DisplayState::kBlanked);
  EXPECT_NEAR(rig_->device().brightness(), 0.25, 1e-4);
  EXPECT_TRUE(rig_->device().screen().blanked());
  ASSERT_TRUE(rig_->display().SetBlank(false).ok());
  ASSERT_TRUE(rig_->RunUntil([&] { return SeesFrame(); }));
}

TEST_F(Driver, BlankingInMidVolumeTellsOnce) {
  Start();
  Show();
  rig_->display().Submit(source_->Next(1));
  ASSERT_TRUE(rig_->display().SetBlank(true).ok());
  EXPECT_EQ(Newest().reason, "blanked");
  rig_->RunFor(kSecond);
  EXPECT_EQ(rig_->recorder().Count(2), 1);
  ASSERT_TRUE(rig_->display().SetBlank(false).ok());
  Show();
}

TEST_F(Driver, StopDarkensTheDevice) {
  Start();
  Show();
  rig_->display().Stop();
  EXPECT_FALSE(rig_->device().screen().running());
  EXPECT_FALSE(rig_->transport().is_open());
}

TEST_F(Driver, PredictsSweeps) {
  Start();
  EXPECT_TRUE(rig_->display().ComingSweeps(3).empty());
  Show();
  const sync::TimeNs shown = Newest().time_ns;
  const sync::TimeNs period = 1'000 * kSecond / 30'000;
  EXPECT_EQ(rig_->display().ComingSweeps(2),
            (std::vector<sync::TimeNs>{shown + period, shown + 2 * period}));
  rig_->clock().Advance(period);  // the sweep that begins now does not count as a coming one
  EXPECT_EQ(rig_->display().ComingSweeps(1), (std::vector<sync::TimeNs>{shown + 2 * period}));
  EXPECT_TRUE(rig_->display().ComingSweeps(0).empty());
}

// The device's clock starts when it is plugged in: its times are mapped to ours.
TEST_F(Driver, MapsTheDevicesTime) {
  Start();
  rig_->SetPlugged(false);
  rig_->RunFor(7 * kSecond);
  rig_->SetPlugged(true);
  Show();
  EXPECT_EQ(Newest().time_ns, rig_->clock().Now());
}

TEST(DriverMismatch, IsToldWithBothSides) {
  using Options = std::map<std::string, std::string>;
  Rig other(Options{{"size", "8x8x6"}});
  sync::FakeClock clock;
  emulator::VoxlinkDeviceConfig config;
  config.geometry = Rig(Options{{"size", "8x8x7"}}).display().info().geometry;
  InProcessTransport::Options options;
  options.own_thread = false;
  auto transport = std::make_unique<InProcessTransport>(
      std::make_unique<emulator::VoxlinkDevice>(config, clock), clock, options);
  InProcessTransport& pump = *transport;
  Recorder recorder;
  voxlink::VoxlinkDisplay display(other.display().info(), std::move(transport), clock);
  ASSERT_TRUE(display.Start(&recorder, [] {}).ok());
  for (int i = 0; i < 10; ++i) {
    display.Tick();
    pump.Pump();
  }
  EXPECT_EQ(display.state(), DisplayState::kLost);
  EXPECT_EQ(display.state_reason(),
            "the display is configured as a planar stack of 6 slices of 8x8 pixels, but the device "
            "is a planar stack of 7 slices of 8x8 pixels");
}

}  // namespace
}  // namespace voxeld::display
