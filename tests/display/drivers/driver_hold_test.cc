// Tests the voxlink driver in other modes than plain showing: following sweeps, holding volumes,
// the power limit.
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "tests/display/drivers/driver_fixture.h"

namespace voxeld::display {
namespace {

using sync::kMillisecond;
using sync::kSecond;
using Kind = VolumeOutcome::Kind;

TEST_F(Driver, SaysHowWellItKnowsItsSweeps) {
  Start();
  EXPECT_EQ(rig_->display().Sweeps()->state, sync::SweepLock::State::kUnknown);
  Show();
  EXPECT_EQ(rig_->display().Sweeps()->state, sync::SweepLock::State::kLocking);
  rig_->RunFor(kSecond);
  EXPECT_EQ(rig_->display().Sweeps()->state, sync::SweepLock::State::kLocked);
  EXPECT_NEAR(rig_->display().Sweeps()->drift_ppm, 0, 1);
  EXPECT_EQ(rig_->display().Sweeps()->losses, 0u);
  // The report no longer arrives: a loss, once. Then it does again.
  rig_->faults().Add(
      {.endpoint = 0x82, .what = emulator::Fault::What::kNak, .amount = 900 * kMillisecond});
  rig_->RunFor(800 * kMillisecond);
  EXPECT_EQ(rig_->display().Sweeps()->state, sync::SweepLock::State::kUnknown);
  EXPECT_EQ(rig_->display().Sweeps()->losses, 1u);
  EXPECT_TRUE(rig_->display().ComingSweeps(1).empty());
  rig_->RunFor(kSecond);
  EXPECT_EQ(rig_->display().Sweeps()->state, sync::SweepLock::State::kLocked);
  EXPECT_EQ(rig_->display().Sweeps()->losses, 1u);
}

// A link on which a volume takes one and a half sweeps: each misses the sweep before which it was
// begun.
TEST_F(Driver, CountsVolumesThatMissTheirSweep) {
  // A volume of 1368 bytes in 50 ms.
  Start({{"pacing", "27360"}});
  Show();
  EXPECT_EQ(rig_->display().stats().volumes_late, 0u)
      << "before the first sweep there was none to miss";
  for (int i = 0; i < 5; ++i) Show();
  EXPECT_EQ(rig_->display().stats().volumes_late, 5u);
  Show(0);  // a single picture is in time if it is begun just after a sweep
  EXPECT_EQ(rig_->display().stats().volumes_late, 5u);
}

TEST_F(Driver, HoldsVolumesUntilTheyAreOrderedShown) {
  Make();
  rig_->display().SetHolding();
  rig_->recorder().has_newer = true;
  rig_->Start();
  frame_ = source_->Next(1);
  rig_->display().Submit(frame_);
  rig_->RunFor(kSecond);
  ASSERT_EQ(rig_->recorder().held, std::vector<uint64_t>{1});
  EXPECT_TRUE(rig_->recorder().outcomes.empty());
  EXPECT_FALSE(rig_->device().Seen().has_value());
  const std::vector<sync::TimeNs> coming = rig_->display().ComingSweeps(6);
  ASSERT_EQ(coming.size(), 6u);
  // Not as far in advance as required; then far enough; then for a later sweep.
  rig_->display().OrderShown(1, coming[0], 2);
  rig_->display().OrderShown(7, coming[3], 2);  // not held
  rig_->display().OrderShown(1, coming[2] + 1000, 2);
  rig_->RunFor(kMillisecond);
  rig_->display().OrderShown(1, coming[4], 2);
  rig_->RunFor(kMillisecond);
  const auto& orders = rig_->recorder().orders;
  ASSERT_EQ(orders.size(), 2u);  // the first answer belongs to an order that has been replaced
  EXPECT_EQ(orders[0].at, coming[2] + 1000);
  EXPECT_TRUE(orders[0].taken);
  EXPECT_EQ(orders[1].at, coming[4]);
  EXPECT_TRUE(orders[1].taken);
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  EXPECT_EQ(Newest().kind, Kind::kPresented);
  EXPECT_NEAR(static_cast<double>(Newest().time_ns), static_cast<double>(coming[4]), 1000);
  EXPECT_TRUE(SeesFrame());
  EXPECT_EQ(rig_->display().stats().volumes_late, 0u) << "it was held, not late";
}

TEST_F(Driver, WhatIsHeldOrOnItsWayCanBeDropped) {
  Make();
  rig_->display().SetHolding();
  rig_->recorder().has_newer = true;
  rig_->Start();
  const auto show = [&] {
    frame_ = source_->Next(1);
    rig_->display().Submit(frame_);
    rig_->RunFor(kSecond);
    rig_->display().OrderShown(frame_->volume, rig_->display().ComingSweeps(3)[2], 2);
    ASSERT_TRUE(rig_->RunUntilOutcome(frame_->volume));
    ASSERT_EQ(Newest().kind, Kind::kPresented) << Newest().reason;
    ASSERT_TRUE(SeesFrame());
  };
  show();
  const SliceFramePtr shown = frame_;
  for (const bool held : {true, false}) {
    SCOPED_TRACE(held);
    const SliceFramePtr dropped = source_->Next(1);
    rig_->display().Submit(dropped);
    if (held) rig_->RunFor(kSecond);
    rig_->display().DropHeld(dropped->volume, "another could not have it");
    EXPECT_EQ(Newest().volume, dropped->volume);
    EXPECT_EQ(Newest().kind, Kind::kLost);
    EXPECT_EQ(Newest().reason, "another could not have it");
    rig_->RunFor(kSecond);
    EXPECT_EQ(rig_->recorder().Count(dropped->volume), 1);
    EXPECT_TRUE(SeesFrame()) << "what was shown stays, and is not sent again";
    EXPECT_EQ(rig_->display().state(), DisplayState::kShowing);
    show();
  }
  // Dark and lit again: nothing is shown that was not ordered.
  const SliceFramePtr waits = source_->Next(1);
  rig_->display().Submit(waits);
  rig_->RunFor(kSecond);
  ASSERT_TRUE(rig_->display().SetBlank(true).ok());
  EXPECT_EQ(Newest().kind, Kind::kLost);
  rig_->RunFor(kSecond);
  ASSERT_TRUE(rig_->display().SetBlank(false).ok());
  rig_->RunFor(2 * kSecond);
  EXPECT_EQ(rig_->display().state(), DisplayState::kShowing);
  EXPECT_FALSE(rig_->device().Seen().has_value()) << "its old volume is lit";
  show();
}

// Volumes that were not ordered are not shown, even if captures are made in the meantime.
TEST_F(Driver, CapturesShowNothingThatWasNotOrdered) {
  Make();
  rig_->display().SetHolding();
  rig_->recorder().has_newer = true;
  rig_->Start();
  int captured = 0;
  absl::StatusOr<DecodedVolume> newest = absl::UnknownError("none");
  const auto capture = [&] {
    rig_->display().Capture(5 * kSecond, [&](absl::StatusOr<DecodedVolume> volume) {
      ++captured;
      newest = std::move(volume);
    });
  };
  frame_ = source_->Next(1);
  capture();  // is sent with the first volume, together with its order
  rig_->display().Submit(frame_);
  rig_->RunFor(kSecond);
  rig_->display().OrderShown(1, rig_->display().ComingSweeps(3)[2], 2);
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  ASSERT_EQ(captured, 1);
  ASSERT_TRUE(newest.ok()) << newest.status();
  EXPECT_EQ(newest->Rgb(), FrameToRgb(*frame_));
  const SliceFramePtr dropped = source_->Next(1);
  rig_->display().Submit(dropped);
  rig_->RunFor(kSecond);
  capture();
  rig_->display().DropHeld(2, "not by all");
  rig_->RunFor(2 * kSecond);
  ASSERT_EQ(captured, 2);
  ASSERT_TRUE(newest.ok()) << newest.status();
  EXPECT_EQ(newest->Rgb(), FrameToRgb(*frame_)) << "what is shown, not what was dropped";
  EXPECT_TRUE(SeesFrame());
}

TEST_F(Driver, ALostDisplayLosesWhatWaitsToBeHeld) {
  Make();
  rig_->display().SetHolding();
  rig_->recorder().has_newer = true;
  rig_->Start();
  rig_->display().Submit(source_->Next(1));
  rig_->display().Submit(source_->Next(1));
  rig_->RunFor(100 * kMillisecond);
  rig_->SetPlugged(false);
  rig_->RunFor(10 * kMillisecond);
  EXPECT_EQ(rig_->recorder().Count(1), 1);
  EXPECT_EQ(rig_->recorder().Count(2), 1);
  rig_->SetPlugged(true);
  rig_->RunFor(2 * kSecond);
  EXPECT_TRUE(rig_->display().mailbox_free());
  EXPECT_EQ(rig_->recorder().held, std::vector<uint64_t>{1});
}

TEST_F(Driver, AGenlockWantsADeviceThatGoesDark) {
  Make({{"watchdog", "false"}});
  rig_->display().SetHolding();
  rig_->Start();
  rig_->RunFor(kSecond);
  EXPECT_EQ(rig_->display().state(), DisplayState::kLost);
  EXPECT_NE(rig_->display().state_reason().find("must have a watchdog (feature bit 0)"),
            std::string::npos)
      << rig_->display().state_reason();
}

TEST_F(Driver, TheDeviceKeepsThePowerLimit) {
  Start();
  EXPECT_EQ(rig_->device().power_limit_mw(), 0u);
  ASSERT_TRUE(rig_->display().SetPowerLimit(12.5).ok());
  rig_->RunFor(100 * kMillisecond);
  EXPECT_EQ(rig_->device().power_limit_mw(), 12500u);
  // A device that returns gets the limit again; one from before the limit was removed gets none.
  rig_->SetPlugged(false);
  rig_->RunFor(100 * kMillisecond);
  rig_->SetPlugged(true);
  rig_->RunFor(2 * kSecond);
  EXPECT_EQ(rig_->device().power_limit_mw(), 12500u);
  ASSERT_TRUE(rig_->display().SetPowerLimit(0).ok());
  rig_->RunFor(100 * kMillisecond);
  EXPECT_EQ(rig_->device().power_limit_mw(), 0u);
  for (const double wrong : {-1.0, 2e6, std::nan("")}) {
    EXPECT_EQ(rig_->display().SetPowerLimit(wrong).code(), absl::StatusCode::kInvalidArgument);
  }
  // A limit that a device has from before is removed, even if it was not seen to return.
  ASSERT_TRUE(rig_->display().SetPowerLimit(40).ok());
  rig_->RunFor(100 * kMillisecond);
  rig_->faults().Add({.endpoint = 0x82, .what = emulator::Fault::What::kStall});
  rig_->faults().Add({.endpoint = 0x82, .what = emulator::Fault::What::kError, .amount = 20});
  rig_->RunUntil([&] { return rig_->display().state() == DisplayState::kLost; });
  ASSERT_TRUE(rig_->display().SetPowerLimit(0).ok());
  rig_->RunFor(10 * kSecond);
  ASSERT_EQ(rig_->display().state(), DisplayState::kShowing);
  EXPECT_EQ(rig_->device().power_limit_mw(), 0u);
  Start({{"device_power_limit", "false"}});
  EXPECT_EQ(rig_->display().SetPowerLimit(5).code(), absl::StatusCode::kUnimplemented);
  EXPECT_FALSE(rig_->display().keeps_power_limit());
}

}  // namespace
}  // namespace voxeld::display
