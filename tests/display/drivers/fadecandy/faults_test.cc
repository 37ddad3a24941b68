// Tests boards that are unplugged and plugged in, and transfers that fail.

#include <memory>
#include <optional>
#include <utility>

#include "display/api/pixels.h"
#include "tests/display/drivers/fadecandy/display_fixture.h"

namespace voxeld::display::fadecandy {
namespace {

// ---- boards that are unplugged and plugged in

TEST_F(Fadecandy, AMissingBoardIsNamed) {
  Make(3);
  rig_->SetPlugged(1, false);
  rig_->Start();
  Submit();
  rig_->RunFor(3 * kSecond);
  EXPECT_EQ(state(), DisplayState::kAttaching);  // it never was there
  EXPECT_EQ(rig_->display().state_reason(), "board 2 (serial B): the emulated device is unplugged");
  EXPECT_TRUE(rig_->recorder().outcomes.empty());
  EXPECT_FALSE(rig_->transport(0).is_open());
  rig_->SetPlugged(1, true);
  ASSERT_TRUE(rig_->RunUntilOutcome(1, 50 * kMillisecond));
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
}

TEST_F(Fadecandy, OneOfThreeUnpluggedInMidFrame) {
  Start(3);
  Show();
  const SliceFramePtr before = frame_;
  Break(2, Fault::What::kNak, 20 * kMillisecond);
  Submit();
  rig_->RunFor(5 * kMillisecond);
  rig_->SetPlugged(2, false);
  ASSERT_TRUE(rig_->RunUntilOutcome(2));
  EXPECT_EQ(Newest().kind, Kind::kLost);
  EXPECT_EQ(Newest().reason, "board 3 (serial C): it was unplugged");
  EXPECT_EQ(state(), DisplayState::kLost);
  rig_->RunFor(kSecond);
  // The others keep what they showed.
  EXPECT_TRUE(rig_->Sees(0, *before));
  EXPECT_TRUE(rig_->Sees(1, *before));
  EXPECT_TRUE(rig_->IsDark(2));
  // The board that returns shows only black and the newest volume; the others only what they had
  // and that volume.
  bool stale = false;
  rig_->SetObserver([&] {
    stale |= !rig_->IsDark(2) && !rig_->Sees(2, *frame_);
    for (size_t b = 0; b < 2; ++b) stale |= !rig_->Sees(b, *before) && !rig_->Sees(b, *frame_);
  });
  rig_->SetPlugged(2, true);
  ASSERT_TRUE(rig_->RunUntil([&] { return rig_->Sees(*frame_); }, kSecond));
  EXPECT_FALSE(stale);
  EXPECT_EQ(rig_->recorder().Count(2), 1);
  EXPECT_EQ(stats().attaches, 2u);
}

TEST_F(Fadecandy, AnIdleBoardIsMissedAsWell) {
  Start(2);
  Show();
  rig_->RunFor(10 * kSecond);
  EXPECT_EQ(state(), DisplayState::kShowing);
  rig_->SetPlugged(0, false);
  rig_->RunFor(80 * kMillisecond);
  EXPECT_EQ(state(), DisplayState::kLost);
  EXPECT_EQ(rig_->display().state_reason(), "board 1 (serial A): it was unplugged");
}

TEST_F(Fadecandy, SurvivesReplugsInQuickSuccession) {
  Start(3);
  Show();
  for (int i = 0; i < 20; ++i) {
    const size_t board = static_cast<size_t>(i) % 3;
    rig_->SetPlugged(board, false);
    rig_->RunFor((i % 5) * 7 * kMillisecond);
    rig_->SetPlugged(board, true);
    rig_->RunFor((i % 7) * 11 * kMillisecond);
    Submit();
  }
  ASSERT_TRUE(rig_->RunUntil([&] { return rig_->Sees(*frame_); }, 20 * kSecond));
  for (uint64_t volume = 1; volume <= frame_->volume; ++volume) {
    EXPECT_EQ(rig_->recorder().Count(volume), 1);
  }
}

// Whichever the bus lists first, slices are in ascending order of serial.
TEST_F(Fadecandy, BoardsWithoutAnOrderOfTheirOwnAreSorted) {
  rig_ = std::make_unique<FadecandyRig>(3, FadecandyRig::Straight(), true);
  source_ = std::make_unique<FrameSource>(rig_->display().info().layout, 1);
  rig_->Start();
  Submit();
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  rig_->RunFor(2 * kRefresh);
  for (size_t device = 0; device < 3; ++device) {  // Z, Y, X
    const int lit = rig_->device(device).Output()[0];
    const int wanted = std::to_integer<int>(frame_->bytes[(2 - device) * kFrameBytes]);
    EXPECT_EQ(lit, wanted < 128 ? wanted : wanted + 1);
  }
  std::optional<absl::StatusOr<DecodedVolume>> captured;
  rig_->display().Capture(kSecond,
                          [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
  ASSERT_TRUE(rig_->RunUntil([&] { return captured.has_value(); }));
  EXPECT_EQ((*captured)->Rgb(), FrameToRgb(*frame_));
  rig_->SetPlugged(2, false);
  rig_->RunFor(80 * kMillisecond);
  EXPECT_EQ(rig_->display().state_reason(), "board 1 (serial X): it was unplugged");
}

// ---- transfers that fail

TEST_F(Fadecandy, AStallIsClearedAndTheFrameGoesAgain) {
  Start(2);
  Show();
  Break(1, Fault::What::kStall);
  Show();
  EXPECT_EQ(Newest().bytes_sent, 2 * 1600u + 24 * 64);
  EXPECT_EQ(stats().slices_resent, 1u);
  // The last packet of a board that has received all others.
  Break(0, Fault::What::kNak, 20 * kMillisecond);
  Submit();
  rig_->RunFor(5 * kMillisecond);
  Break(1, Fault::What::kStall);
  ASSERT_TRUE(rig_->RunUntilOutcome(3));
  EXPECT_EQ(Newest().kind, Kind::kPresented);
  EXPECT_EQ(Newest().bytes_sent, 2 * 1600u + 64 + 1536);
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
  EXPECT_EQ(stats().slices_resent, 2u);
  EXPECT_EQ(stats().transfers_failed, 2u);
  EXPECT_EQ(stats().attaches, 1u);
  EXPECT_EQ(stats().volumes_lost, 0u);
}

TEST_F(Fadecandy, SurvivesErrorsPartialTransfersAndDelays) {
  Start(2);
  Show();
  for (const auto& [what, amount] : {std::pair{Fault::What::kStall, 0},
                                     {Fault::What::kError, 3},
                                     {Fault::What::kBabble, 2},
                                     {Fault::What::kPartial, 100},
                                     {Fault::What::kPartial, 1024},
                                     {Fault::What::kNak, 300'000'000},
                                     {Fault::What::kDelay, 300'000'000}}) {
    Break(0, what, static_cast<uint64_t>(amount));
    Show(0.5);
    Break(1, what, static_cast<uint64_t>(amount));
    Show();
  }
  EXPECT_EQ(stats().attaches, 1u);
  EXPECT_EQ(stats().volumes_lost, 0u);
}

TEST_F(Fadecandy, AFaultDuringSetUp) {
  for (const auto what : {Fault::What::kStall, Fault::What::kPartial, Fault::What::kError}) {
    Make(2);
    rig_->faults(1).Add({.at = 1, .what = what, .amount = 2});
    rig_->Start();
    Show();
    EXPECT_EQ(stats().attaches, 1u);
  }
}

TEST_F(Fadecandy, ABoardThatTakesNothingIsResetAndAttachedAnew) {
  Start(2);
  Show();
  Break(1, Fault::What::kNak, 3 * kSecond);
  Submit();
  ASSERT_TRUE(rig_->RunUntilOutcome(2));
  EXPECT_EQ(Newest().kind, Kind::kLost);
  EXPECT_EQ(Newest().reason, "board 2 (serial B): it took no bytes for 1000 ms");
  ASSERT_TRUE(rig_->RunUntil([&] { return rig_->Sees(*frame_); }, 20 * kSecond));
  EXPECT_EQ(rig_->recorder().Count(2), 1);
}

TEST_F(Fadecandy, BacksOffFromABoardThatKeepsFailing) {
  Start(2);
  Break(0, Fault::What::kError, 1'000'000);
  Submit();
  rig_->RunFor(60 * kSecond);
  EXPECT_EQ(state(), DisplayState::kLost);
  EXPECT_EQ(rig_->display().state_reason(),
            "board 1 (serial A): transfers failed 6 times in a row, the last one: protocol error");
  EXPECT_EQ(Newest().kind, Kind::kLost);
  EXPECT_EQ(rig_->recorder().Count(1), 1);
  int losses = 0;
  for (const auto& [state, reason] : rig_->recorder().states) {
    losses += state == DisplayState::kLost ? 1 : 0;
  }
  EXPECT_LT(losses, 25);
}

}  // namespace
}  // namespace voxeld::display::fadecandy
