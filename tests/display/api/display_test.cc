// Tests the base class, with a driver that is controlled by the test.
#include "display/api/display.h"

#include <string>
#include <utility>
#include <vector>

#include "tests/display/api/display_fixture.h"

namespace voxeld::display {
namespace {

TEST_F(DisplayTest, StatesAreToldInOrder) {
  EXPECT_EQ(display_.state(), DisplayState::kStopped);
  StartAttached();
  display_.DeviceLost("gone");
  EXPECT_EQ(display_.state_reason(), "gone");
  display_.Attached();
  ASSERT_TRUE(display_.SetBlank(true).ok());
  ASSERT_TRUE(display_.SetBlank(false).ok());
  display_.Stop();
  EXPECT_EQ(log_.states, (std::vector<DisplayState>{
                             DisplayState::kAttaching, DisplayState::kShowing, DisplayState::kLost,
                             DisplayState::kShowing, DisplayState::kBlanked, DisplayState::kShowing,
                             DisplayState::kStopped}));
  EXPECT_STREQ(DisplayStateName(DisplayState::kAttaching), "attaching");
}

TEST_F(DisplayTest, StartsOnceAndAgainAfterStop) {
  Start();
  EXPECT_EQ(display_.Start(&log_, [] {}).code(), absl::StatusCode::kFailedPrecondition);
  display_.Stop();
  display_.Stop();
  EXPECT_EQ(display_.calls, std::vector<std::string>{"stop"});
  StartAttached();
  display_.Submit(Frame(1));
  EXPECT_EQ(display_.sent.size(), 1u);
}

TEST_F(DisplayTest, AStartThatFailsLeavesItStopped) {
  display_.start_status = absl::InternalError("no bus");
  EXPECT_EQ(display_.Start(&log_, [] {}).message(), "no bus");
  EXPECT_EQ(display_.state(), DisplayState::kStopped);
  EXPECT_EQ(display_.state_reason(), "no bus");
}

TEST_F(DisplayTest, PresentsWithTimesAndBytes) {
  StartAttached();
  display_.Submit(Frame(1));
  EXPECT_TRUE(display_.mailbox_free());
  display_.FrameDone(500, Evidence::kDevice, 400, 77);
  ASSERT_EQ(log_.outcomes.size(), 1u);
  ExpectOutcome(0, 1, Kind::kPresented);
  EXPECT_EQ(log_.outcomes[0].time_ns, 500);
  EXPECT_EQ(log_.outcomes[0].evidence, Evidence::kDevice);
  EXPECT_EQ(log_.outcomes[0].last_byte_ns, 400);
  EXPECT_EQ(log_.outcomes[0].bytes_sent, 77u);
  EXPECT_EQ(display_.stats().volumes_presented, 1u);
  display_.Done();  // nothing is in flight: a driver's late report changes nothing
  display_.FrameLost("late", 0);
  EXPECT_EQ(log_.outcomes.size(), 1u);
}

TEST_F(DisplayTest, TheMailboxKeepsTheNewest) {
  StartAttached();
  for (uint64_t volume = 1; volume <= 4; ++volume) display_.Submit(Frame(volume));
  EXPECT_FALSE(display_.mailbox_free());
  ASSERT_EQ(log_.outcomes.size(), 2u);
  ExpectOutcome(0, 2, Kind::kReplaced);
  EXPECT_EQ(log_.outcomes[0].replaced_by, 3u);
  ExpectOutcome(1, 3, Kind::kReplaced);
  EXPECT_EQ(log_.outcomes[1].replaced_by, 4u);
  display_.Done();
  EXPECT_TRUE(display_.mailbox_free());
  display_.Done();
  ExpectOutcome(2, 1, Kind::kPresented);
  ExpectOutcome(3, 4, Kind::kPresented);
  EXPECT_EQ(display_.sent, (std::vector<ScriptedDisplay::Sent>{{1, true}, {4, false}}));
  EXPECT_EQ(display_.stats().volumes_submitted, 4u);
  EXPECT_EQ(display_.stats().volumes_replaced, 2u);
}

TEST_F(DisplayTest, RefusesNumbersThatDoNotAscendAndOtherLayouts) {
  StartAttached();
  display_.Submit(Frame(5));
  display_.Submit(Frame(5));
  ExpectOutcome(0, 5, Kind::kLost, "volume 5 does not follow volume 5: numbers must ascend");
  SliceFrame frame = *Frame(6);
  frame.bytes.pop_back();
  display_.Submit(std::make_shared<SliceFrame>(frame));
  ExpectOutcome(1, 6, Kind::kLost, "the volume is not of the display's layout");
  frame = *Frame(7);
  frame.layout.width = 1;
  display_.Submit(std::make_shared<SliceFrame>(frame));
  ExpectOutcome(2, 7, Kind::kLost, "the volume is not of the display's layout");
  EXPECT_EQ(display_.sent.size(), 1u);
}

TEST_F(DisplayTest, WaitsForTheDevice) {
  Start();
  display_.Submit(Frame(1));
  display_.Submit(Frame(2));
  EXPECT_TRUE(display_.sent.empty());
  display_.Attached();
  EXPECT_EQ(display_.sent, (std::vector<ScriptedDisplay::Sent>{{2, true}}));
  ASSERT_EQ(log_.outcomes.size(), 1u);
  ExpectOutcome(0, 1, Kind::kReplaced);
}

TEST_F(DisplayTest, LosingTheDeviceLosesWhatIsInFlightAndKeepsWhatWaits) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Submit(Frame(2));
  display_.DeviceLost("unplugged", 12);
  ASSERT_EQ(log_.outcomes.size(), 1u);
  ExpectOutcome(0, 1, Kind::kLost, "unplugged");
  EXPECT_EQ(log_.outcomes[0].bytes_sent, 12u);
  display_.Attached();
  EXPECT_EQ(display_.sent, (std::vector<ScriptedDisplay::Sent>{{1, true}, {2, true}}));
  display_.Done();
  ExpectOutcome(1, 2, Kind::kPresented);
}

TEST_F(DisplayTest, AfterAttachTheCurrentFrameGoesOutWholeAndOwesNothing) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Done();
  display_.Submit(Frame(2));
  display_.Done();
  display_.DeviceLost("unplugged");
  display_.Attached();
  EXPECT_EQ(display_.sent, (std::vector<ScriptedDisplay::Sent>{{1, true}, {2, false}, {2, true}}));
  display_.Done();
  EXPECT_EQ(log_.outcomes.size(), 2u);
  display_.Submit(Frame(3));
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{3, false}));
}

TEST_F(DisplayTest, ALostVolumeIsSentAgainLaterAndLater) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.FrameLost("slices missing", 5);
  ExpectOutcome(0, 1, Kind::kLost, "slices missing");
  EXPECT_EQ(log_.outcomes[0].bytes_sent, 5u);
  EXPECT_EQ(display_.Tick(), clock_.Now() + 100 * kMillisecond);
  clock_.Advance(99 * kMillisecond);
  display_.Tick();
  EXPECT_EQ(display_.sent.size(), 1u);
  clock_.Advance(kMillisecond);
  display_.Tick();
  EXPECT_EQ(display_.sent, (std::vector<ScriptedDisplay::Sent>{{1, true}, {1, true}}));
  display_.FrameLost("again", 5);
  EXPECT_EQ(display_.Tick(), clock_.Now() + 200 * kMillisecond);
  display_.Submit(Frame(2));  // a newer one does not have to wait
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{2, true}));
  display_.Done();
  clock_.Advance(kSecond);
  display_.Tick();
  EXPECT_EQ(display_.sent.size(), 3u);
  EXPECT_EQ(log_.outcomes.size(), 2u);
}

TEST_F(DisplayTest, ADriverMayEndAVolumeInsideSend) {
  StartAttached();
  display_.done_at_once = true;
  for (uint64_t volume = 1; volume <= 3; ++volume) display_.Submit(Frame(volume));
  EXPECT_EQ(display_.stats().volumes_presented, 3u);
  display_.done_at_once = false;
  display_.lost_at_once = true;
  display_.Submit(Frame(4));
  EXPECT_EQ(display_.sent.size(), 4u);  // the re-send waits for its time
  ExpectOutcome(3, 4, Kind::kLost, "script");
}

TEST_F(DisplayTest, BlankLosesAllAndRefusesMore) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Submit(Frame(2));
  ASSERT_TRUE(display_.SetBlank(true).ok());
  EXPECT_EQ(display_.state(), DisplayState::kBlanked);
  ExpectOutcome(0, 1, Kind::kLost, "blanked");
  ExpectOutcome(1, 2, Kind::kLost, "blanked");
  display_.Submit(Frame(3));
  ExpectOutcome(2, 3, Kind::kLost, "blanked");
  display_.Done();  // the driver finishes volume 1, whose outcome was already reported
  EXPECT_EQ(log_.outcomes.size(), 3u);
  ASSERT_TRUE(display_.SetBlank(false).ok());
  EXPECT_EQ(display_.calls, (std::vector<std::string>{"blank", "unblank"}));
  EXPECT_EQ(display_.sent.size(), 1u);  // the device still has volume 1
  display_.Submit(Frame(4));
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{4, false}));
}

TEST_F(DisplayTest, ARefusedBlankLeavesAllAsItWas) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Submit(Frame(2));
  Captured captured;
  Capture(captured);
  display_.blank_status = absl::UnavailableError("no answer");
  EXPECT_EQ(display_.SetBlank(true).message(), "no answer");
  EXPECT_FALSE(display_.blanked());
  EXPECT_EQ(display_.state(), DisplayState::kShowing);
  EXPECT_TRUE(log_.outcomes.empty());
  EXPECT_FALSE(captured.has_value());
  display_.Done();
  display_.Done();
  ExpectOutcome(0, 1, Kind::kPresented);
  ExpectOutcome(1, 2, Kind::kPresented);

  display_.blank_status = absl::OkStatus();
  ASSERT_TRUE(display_.SetBlank(true).ok());
  display_.blank_status = absl::UnavailableError("no answer");
  EXPECT_FALSE(display_.SetBlank(false).ok());
  EXPECT_TRUE(display_.blanked());
  EXPECT_EQ(display_.state(), DisplayState::kBlanked);
}

TEST_F(DisplayTest, BlankedWhileAwayItComesBackDarkAndThenWithTheCurrentFrame) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Done();
  display_.DeviceLost("unplugged");
  ASSERT_TRUE(display_.SetBlank(true).ok());
  EXPECT_TRUE(display_.calls.empty());
  display_.Attached();
  EXPECT_EQ(display_.state(), DisplayState::kBlanked);
  EXPECT_EQ(display_.sent.size(), 1u);
  ASSERT_TRUE(display_.SetBlank(false).ok());
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{1, true}));
}

// The device returned while it was dark, and is lit while a newer volume is being drawn: the
// display waits for that, and has nothing to do in the meantime.
TEST_F(DisplayTest, LitAgainItWaitsForTheNewerVolumeWithoutBeingAsked) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Done();
  display_.DeviceLost("unplugged");
  ASSERT_TRUE(display_.SetBlank(true).ok());
  log_.has_newer = true;
  display_.Attached();
  ASSERT_TRUE(display_.SetBlank(false).ok());
  EXPECT_EQ(display_.sent.size(), 1u);
  EXPECT_GT(display_.Tick(), clock_.Now());
  // The newer one turns out the same.
  display_.ShowCurrent();
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{1, true}));
}

// The volume that was to be drawn for the lost device is not drawn; for the device that returns
// there is something newer again.
TEST_F(DisplayTest, WhatWasSaidOfALostDeviceDoesNotKeepTheNextOneBusy) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Done();
  display_.DeviceLost("unplugged");
  log_.has_newer = true;
  display_.Attached();
  display_.DeviceLost("unplugged");
  display_.ShowCurrent();
  display_.Attached();
  EXPECT_EQ(display_.sent.size(), 1u);
  EXPECT_GT(display_.Tick(), clock_.Now());
  display_.ShowCurrent();
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{1, true}));
}

TEST_F(DisplayTest, StopLosesWhatIsOwed) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Submit(Frame(2));
  Captured captured;
  Capture(captured);
  display_.Stop();
  ExpectOutcome(0, 1, Kind::kLost, "the display was stopped");
  ExpectOutcome(1, 2, Kind::kLost, "the display was stopped");
  EXPECT_TRUE(absl::IsUnavailable(captured->status()));
  display_.Submit(Frame(3));
  EXPECT_EQ(log_.outcomes.size(), 2u);
  EXPECT_EQ(display_.Tick(), sync::kNever);
}

TEST_F(DisplayTest, BrightnessIsCheckedKeptAndPassedOn) {
  EXPECT_EQ(display_.SetBrightness(-0.1).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(display_.SetBrightness(1.5).message(), "brightness is 1.5; it must be from 0 to 1");
  EXPECT_FALSE(display_.SetBrightness(std::nan("")).ok());
  Start();
  ASSERT_TRUE(display_.SetBrightness(0.25).ok());
  EXPECT_EQ(display_.brightness(), 0.25);
  EXPECT_TRUE(display_.calls.empty());
  display_.Attached();
  ASSERT_TRUE(display_.SetBrightness(0.5).ok());
  EXPECT_EQ(display_.calls, std::vector<std::string>{"brightness 0.500000"});
  display_.brightness_status = absl::UnimplementedError("has none");
  EXPECT_EQ(display_.SetBrightness(0.75).message(), "has none");
  EXPECT_EQ(display_.brightness(), 0.5);
}

TEST_F(DisplayTest, WhatTickSendsIsTickedAgain) {
  Start();
  display_.Submit(Frame(1));
  display_.in_tick = [&] {
    display_.Attached();
    display_.FrameLost("script", 0);
  };
  EXPECT_EQ(display_.Tick(), clock_.Now() + 100 * kMillisecond);
  clock_.Advance(100 * kMillisecond);
  EXPECT_EQ(display_.Tick(), clock_.Now());
  EXPECT_EQ(display_.sent.size(), 2u);
}

}  // namespace
}  // namespace voxeld::display
