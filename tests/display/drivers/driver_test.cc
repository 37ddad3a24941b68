// The voxlink driver with its device at the other end of an in-process cable, in one thread, on a
// fake clock.

#include <set>

#include "display/api/pixels.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/rig.h"

namespace voxeld::display {
namespace {

using sync::kMillisecond;
using sync::kSecond;

TEST(Driver, AttachesAndShowsAVolume) {
  Rig rig;
  rig.Start();
  ASSERT_EQ(rig.display().state(), DisplayState::kShowing) << rig.display().state_reason();
  FrameSource source(rig.display().info().layout, 1);
  const SliceFramePtr frame = source.Next(1);
  rig.display().Submit(frame);
  EXPECT_FALSE(rig.device().Seen().has_value());
  ASSERT_TRUE(rig.RunUntilOutcome(1));
  const VolumeOutcome outcome = rig.recorder().outcomes[0];
  EXPECT_EQ(outcome.kind, VolumeOutcome::Kind::kPresented) << outcome.reason;
  EXPECT_EQ(outcome.evidence, Evidence::kDevice);
  EXPECT_EQ(outcome.time_ns, rig.clock().Now());
  EXPECT_GT(outcome.last_byte_ns, 0);
  EXPECT_LE(outcome.last_byte_ns, outcome.time_ns);
  // BEGIN, 6 slices, END.
  EXPECT_EQ(outcome.bytes_sent, 56u + 6 * (40 + 192) + 40);
  ASSERT_TRUE(rig.device().Seen().has_value());
  EXPECT_EQ(rig.device().Seen()->rgb, FrameToRgb(*frame));
}

TEST(Driver, CapturesWhatTheDeviceShows) {
  Rig rig;
  rig.Start();
  FrameSource source(rig.display().info().layout, 2);
  rig.display().Submit(source.Next(1));
  ASSERT_TRUE(rig.RunUntilOutcome(1));
  std::optional<absl::StatusOr<DecodedVolume>> captured;
  rig.display().Capture(kSecond, [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
  ASSERT_TRUE(rig.RunUntil([&] { return captured.has_value(); }));
  ASSERT_TRUE(captured->ok()) << captured->status().message();
  EXPECT_EQ((*captured)->volume, 1u);
  EXPECT_EQ((*captured)->rgb, rig.device().Seen()->rgb);
  EXPECT_EQ(rig.recorder().outcomes.size(), 1u);
}

}  // namespace
}  // namespace voxeld::display
