// Tests captures: the next volume shown, rebuilt from the bytes that are sent.
#include <string>
#include <utility>
#include <vector>

#include "display/api/pixels.h"
#include "tests/display/api/display_fixture.h"

namespace voxeld::display {
namespace {

TEST_F(DisplayTest, CaptureTakesTheNextVolumeWhole) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Done();
  display_.Submit(Frame(2));
  Captured captured;
  Capture(captured);  // volume 2 is already on its way, untapped
  EXPECT_FALSE(display_.tapped());
  display_.Submit(Frame(3));
  display_.Done();
  EXPECT_FALSE(captured.has_value());
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{3, true}));
  EXPECT_TRUE(display_.tapped());
  Captured second;
  Capture(second);  // the tap exists: the same volume serves
  display_.Done();
  ASSERT_TRUE(captured.has_value() && captured->ok());
  EXPECT_EQ((*captured)->volume, 3u);
  EXPECT_EQ((*captured)->Rgb(), FrameToRgb(*Frame(3)));
  ASSERT_TRUE(second.has_value() && second->ok());
  EXPECT_FALSE(display_.tapped());
  EXPECT_EQ(display_.sent.size(), 3u);
}

TEST_F(DisplayTest, CaptureSendsTheCurrentVolumeAgainWithoutAnOutcome) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Done();
  Captured captured;
  Capture(captured);
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{1, true}));
  display_.Done();
  EXPECT_TRUE(captured->ok());
  EXPECT_EQ(log_.outcomes.size(), 1u);
}

TEST_F(DisplayTest, CaptureOfADisplayThatNeverHadAVolumeIsBlack) {
  StartAttached();
  Captured captured;
  Capture(captured);
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{0, true}));
  display_.Done();
  ASSERT_TRUE(captured->ok());
  EXPECT_EQ((*captured)->volume, 0u);
  EXPECT_EQ((*captured)->Rgb(), std::vector<uint8_t>(12, 0));
  display_.Submit(Frame(1));  // a black volume cannot be a base
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{1, true}));
}

TEST_F(DisplayTest, CaptureWaitsForTheDeviceAndGivesUp) {
  Start();
  Captured early, late;
  Capture(early, 10 * kMillisecond);
  Capture(late, kSecond);
  EXPECT_EQ(display_.Tick(), clock_.Now() + 10 * kMillisecond);
  clock_.Advance(10 * kMillisecond);
  display_.Tick();
  ASSERT_TRUE(early.has_value());
  EXPECT_TRUE(absl::IsDeadlineExceeded(early->status()));
  display_.Attached();
  display_.Done();
  ASSERT_TRUE(late.has_value());
  EXPECT_TRUE(late->ok());
}

TEST_F(DisplayTest, ACancelledCaptureGoesAndOthersStay) {
  StartAttached();
  display_.Submit(Frame(1));
  Captured gone, stays;
  display_.Capture(
      kSecond, [&gone](absl::StatusOr<DecodedVolume> v) { gone = std::move(v); }, 7);
  display_.CancelCapture(8);
  EXPECT_FALSE(gone.has_value());
  display_.CancelCapture(7);
  ASSERT_TRUE(gone.has_value());
  EXPECT_TRUE(absl::IsCancelled(gone->status()));
  EXPECT_EQ(display_.Tick(), clock_.Now() + kSecond) << "only the driver's own time";
  Capture(stays);
  display_.Done();
  EXPECT_TRUE(display_.tapped());
  display_.CancelCapture(7);
  display_.Done();
  ASSERT_TRUE(stays.has_value());
  EXPECT_TRUE(stays->ok());
}

TEST_F(DisplayTest, CaptureEndsWithTheDeviceOrTheLight) {
  StartAttached();
  display_.Submit(Frame(1));
  Captured lost, blanked, at_once;
  Capture(lost);
  display_.DeviceLost("unplugged");
  ASSERT_TRUE(lost.has_value());
  EXPECT_TRUE(absl::IsUnavailable(lost->status()));
  Capture(at_once);
  ASSERT_TRUE(at_once.has_value());
  EXPECT_TRUE(absl::IsUnavailable(at_once->status()));
  display_.Attached();
  Capture(blanked);
  ASSERT_TRUE(display_.SetBlank(true).ok());
  ASSERT_TRUE(blanked.has_value());
  EXPECT_TRUE(absl::IsUnavailable(blanked->status()));
}

TEST_F(DisplayTest, CaptureOutlivesALostVolume) {
  StartAttached();
  Captured captured;
  display_.Submit(Frame(1));
  display_.Done();
  Capture(captured);
  display_.FrameLost("noise", 0);
  EXPECT_FALSE(captured.has_value());
  clock_.Advance(100 * kMillisecond);
  display_.Tick();
  display_.Done();
  ASSERT_TRUE(captured.has_value());
  EXPECT_TRUE(captured->ok());
}

TEST_F(DisplayTest, CaptureTellsOfBytesThatBreakTheProtocol) {
  StartAttached();
  display_.tap_bytes = 0;
  Captured broken, torn;
  Capture(broken);
  display_.Done();
  EXPECT_TRUE(absl::IsDataLoss(broken->status()));
  display_.tap_bytes = 3;
  Capture(torn);
  display_.Done();
  EXPECT_TRUE(absl::IsInternal(torn->status()));
}

TEST_F(DisplayTest, AWatchBeginsWholeAndGoesOnWithWhatChanges) {
  StartAttached();
  display_.Submit(Frame(1));
  display_.Done();
  std::vector<uint64_t> seen;
  display_.Watch([&](const absl::StatusOr<DecodedVolume>& volume) {
    ASSERT_TRUE(volume.ok());
    seen.push_back(volume->volume);
  });
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{1, true}));
  display_.Done();
  display_.Submit(Frame(2));
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{2, false}));
  display_.Done();
  EXPECT_EQ(seen, (std::vector<uint64_t>{1, 2}));
  EXPECT_EQ(display_.sent.size(), 3u) << "nothing is sent for a watcher while nothing is new";
  EXPECT_TRUE(display_.tapped());

  // The lost volume is sent again whole.
  display_.Submit(Frame(3));
  display_.FrameLost("script", 3);
  clock_.Advance(kSecond);
  display_.Tick();
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{3, true}));
  display_.Done();
  EXPECT_EQ(seen.back(), 3u);
  display_.Unwatch();
  EXPECT_FALSE(display_.tapped());
  display_.Submit(Frame(4));
  EXPECT_EQ(display_.sent.back(), (ScriptedDisplay::Sent{4, false}));
  display_.Done();
  EXPECT_EQ(seen.back(), 3u);
  EXPECT_EQ(log_.outcomes.size(), 4u) << "one for each volume, and none for what was sent again";
}

}  // namespace
}  // namespace voxeld::display
