// Tests the Fadecandy driver with its boards at the other ends of in-process cables, in one thread,
// on a fake clock.

#include <memory>
#include <optional>
#include <string>

#include "display/api/pixels.h"
#include "tests/display/drivers/fadecandy/display_fixture.h"

namespace voxeld::display::fadecandy {
namespace {

TEST_F(Fadecandy, IsDarkUntilThereAreTableAndFrame) {
  Make(2);
  bool lit = false;
  rig_->SetObserver([&] { lit |= !rig_->IsDark(0) || !rig_->IsDark(1); });
  rig_->Start();
  rig_->RunFor(kSecond);
  EXPECT_EQ(state(), DisplayState::kShowing);
  EXPECT_EQ(stats().attaches, 1u);
  for (size_t b = 0; b < 2; ++b) {
    EXPECT_EQ(rig_->device(b).light().flags(), kNoDither | kNoInterpolation);
    EXPECT_EQ(rig_->device(b).light().frames(), 2u);  // black
  }
  EXPECT_FALSE(lit);
  rig_->SetObserver(nullptr);
  Show();
}

TEST_F(Fadecandy, PresentsAVolumeWhenAllBoardsHaveIt) {
  Start(3);
  Submit();
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  EXPECT_EQ(Newest().kind, Kind::kPresented) << Newest().reason;
  EXPECT_EQ(Newest().evidence, Evidence::kEstimated);
  EXPECT_EQ(Newest().time_ns, rig_->clock().Now());
  EXPECT_LE(Newest().last_byte_ns, Newest().time_ns);
  EXPECT_EQ(Newest().bytes_sent, 3 * 1600u);
  EXPECT_EQ(stats().slices_sent, 3u);
  EXPECT_EQ(stats().slices_resent, 0u);
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
}

TEST_F(Fadecandy, SendsOnlyToBoardsThatChange) {
  Start(3);
  Show();
  SliceFrame next = *frame_;
  next.volume = 2;
  next.changed_in[1] = 2;
  next.bytes[kFrameBytes] ^= std::byte{1};
  const uint32_t frames[] = {rig_->device(0).light().frames(), rig_->device(1).light().frames()};
  frame_ = std::make_shared<SliceFrame>(next);
  rig_->display().Submit(frame_);
  ASSERT_TRUE(rig_->RunUntilOutcome(2));
  EXPECT_EQ(Newest().bytes_sent, 1600u);
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
  EXPECT_EQ(rig_->device(0).light().frames(), frames[0]);
  EXPECT_EQ(rig_->device(1).light().frames(), frames[1] + 1);
  // Nothing changes at all.
  next.volume = 3;
  rig_->display().Submit(std::make_shared<SliceFrame>(next));
  ASSERT_TRUE(rig_->RunUntilOutcome(3));
  EXPECT_EQ(Newest().kind, Kind::kPresented);
  EXPECT_EQ(Newest().bytes_sent, 0u);
}

TEST_F(Fadecandy, NoBoardShowsAVolumeBeforeAllHaveMostOfIt) {
  Start(3);
  Show();
  const SliceFramePtr before = frame_;
  Break(1, Fault::What::kNak, 200 * kMillisecond);
  Submit();
  rig_->RunFor(150 * kMillisecond);
  EXPECT_TRUE(rig_->Sees(*before));
  ASSERT_TRUE(rig_->RunUntilOutcome(2));
  EXPECT_EQ(Newest().kind, Kind::kPresented);
  // Two refreshes later all boards show it: the last packets were sent together.
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
}

TEST_F(Fadecandy, APixelIsTheLedThatItsNumberSays) {
  Start(2);
  for (const auto& [slice, pixel, strip, led] : {std::array<size_t, 4>{0, 0, 0, 0},
                                                 {0, 63, 0, 63},
                                                 {0, 64, 1, 0},
                                                 {1, 197, 3, 5},
                                                 {1, 504, 7, 56},
                                                 {1, 511, 7, 63}}) {
    auto frame = std::make_shared<SliceFrame>();
    frame->volume = stats().volumes_submitted + 1;
    frame->layout = rig_->display().info().layout;
    frame->bytes.resize(frame->layout.bytes());
    frame->changed_in = {frame->volume, frame->volume};
    for (size_t c = 0; c < 3; ++c) {
      frame->bytes[slice * kFrameBytes + pixel * 3 + c] = static_cast<std::byte>(10 * (c + 1));
    }
    rig_->display().Submit(frame);
    ASSERT_TRUE(rig_->RunUntilOutcome(frame->volume));
    rig_->RunFor(2 * kRefresh);
    for (size_t b = 0; b < 2; ++b) {
      for (size_t s = 0; s < kStrips; ++s) {
        const auto out = rig_->device(b).light().Strip(s);
        for (size_t i = 0; i < out.size(); ++i) {
          const bool here = b == slice && s == strip && i / 3 == led;
          const int grb[] = {20, 10, 30};
          ASSERT_EQ(out[i], here ? grb[i % 3] : 0)
              << "board " << b << " strip " << s << " LED " << i / 3;
        }
      }
    }
  }
}

TEST_F(Fadecandy, KeepsUpWithTheRefreshAndNotMore) {
  Start(2);
  Show();
  const uint32_t frames = rig_->device(0).light().frames();
  const sync::TimeNs begin = rig_->clock().Now();
  for (int i = 0; i < 40; ++i) {
    Submit();
    ASSERT_TRUE(rig_->RunUntilOutcome(frame_->volume));
  }
  EXPECT_NEAR(static_cast<double>(rig_->clock().Now() - begin), 40.0 * kRefresh, 2.0 * kRefresh);
  rig_->RunFor(2 * kRefresh);
  EXPECT_EQ(rig_->device(0).light().frames(), frames + 40);
  EXPECT_EQ(stats().volumes_presented, 41u);
}

// ---- brightness, darkness

TEST_F(Fadecandy, BrightnessIsTheBoardsTable) {
  Make(2);
  ASSERT_TRUE(rig_->display().SetBrightness(0.5).ok());
  rig_->Start();
  frame_ = source_->Next(1);
  rig_->display().Submit(frame_);
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  rig_->RunFor(2 * kRefresh);
  const auto light = [&](size_t board, size_t i) {
    return static_cast<double>(rig_->device(board).Output()[i]);
  };
  const auto wanted = [&](size_t i) { return std::to_integer<int>(frame_->bytes[i]); };
  for (size_t i = 0; i < kFrameBytes; ++i) ASSERT_NEAR(light(0, i), wanted(i) / 2.0, 1);
  const uint32_t frames = rig_->device(0).light().frames();
  ASSERT_TRUE(rig_->display().SetBrightness(0.25).ok());
  rig_->RunFor(2 * kRefresh);
  for (size_t i = 0; i < kFrameBytes; ++i) ASSERT_NEAR(light(0, i), wanted(i) / 4.0, 1);
  EXPECT_EQ(rig_->device(0).light().frames(), frames);
  // It is part of the set-up.
  rig_->SetPlugged(1, false);
  rig_->RunFor(kSecond);
  rig_->SetPlugged(1, true);
  rig_->RunFor(6 * kSecond);
  for (size_t i = 0; i < kFrameBytes; ++i) {
    ASSERT_NEAR(light(1, i), wanted(kFrameBytes + i) / 4.0, 1);
  }
}

TEST_F(Fadecandy, ASliderForBrightnessDoesNotHoldFramesUp) {
  Start(1);
  for (int i = 0; i < 50; ++i) {
    Submit();
    for (int k = 0; k < 20; ++k) {
      ASSERT_TRUE(rig_->display().SetBrightness(0.01 * (k + 1)).ok());
      rig_->display().Tick();
      rig_->transport(0).Pump();
    }
    rig_->RunFor(kRefresh);
  }
  EXPECT_GT(stats().volumes_presented, 30u);
  ASSERT_TRUE(rig_->display().SetBrightness(1).ok());
  ASSERT_TRUE(rig_->RunUntil([&] { return rig_->Sees(*frame_); }));
}

TEST_F(Fadecandy, BlankIsDarkAtOnceAndLightComesBackWhole) {
  Start(2);
  Show();
  const uint32_t frames = rig_->device(0).light().frames();
  ASSERT_TRUE(rig_->display().SetBlank(true).ok());
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->IsDark(0) && rig_->IsDark(1));
  EXPECT_EQ(state(), DisplayState::kBlanked);
  ASSERT_TRUE(rig_->display().SetBrightness(0.5).ok());
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->IsDark(0) && rig_->IsDark(1));
  ASSERT_TRUE(rig_->display().SetBrightness(1).ok());
  ASSERT_TRUE(rig_->display().SetBlank(false).ok());
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
  EXPECT_EQ(rig_->device(0).light().frames(), frames);
}

TEST_F(Fadecandy, BlankedInMidVolume) {
  Start(2);
  Show();
  Break(1, Fault::What::kNak, 50 * kMillisecond);
  Submit();
  rig_->Settle();
  ASSERT_TRUE(rig_->display().SetBlank(true).ok());
  EXPECT_EQ(Newest().reason, "blanked");
  rig_->RunFor(100 * kMillisecond);
  EXPECT_EQ(rig_->recorder().Count(2), 1);
  ASSERT_TRUE(rig_->display().SetBlank(false).ok());
  rig_->RunFor(2 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
}

TEST_F(Fadecandy, WhatIsAskedForDuringSetUpHolds) {
  Start(2);
  Show();
  for (const bool blank : {true, false}) {
    rig_->SetPlugged(1, false);
    rig_->RunFor(kSecond);
    Break(1, Fault::What::kNak, 200 * kMillisecond);
    rig_->SetPlugged(1, true);
    rig_->RunFor(100 * kMillisecond);
    EXPECT_EQ(state(), DisplayState::kLost);  // it is being set up
    ASSERT_TRUE(rig_->display().SetBlank(blank).ok());
    rig_->RunFor(2 * kSecond);
    EXPECT_EQ(rig_->transport(0).is_open(), true);
    if (blank) {
      EXPECT_EQ(state(), DisplayState::kBlanked);
      EXPECT_TRUE(rig_->IsDark(0) && rig_->IsDark(1));
    } else {
      EXPECT_EQ(state(), DisplayState::kShowing);
      EXPECT_TRUE(rig_->Sees(*frame_));
    }
  }
  rig_->SetPlugged(1, false);
  rig_->RunFor(kSecond);
  Break(1, Fault::What::kNak, 200 * kMillisecond);
  rig_->SetPlugged(1, true);
  rig_->RunFor(100 * kMillisecond);
  ASSERT_TRUE(rig_->display().SetBrightness(0).ok());
  rig_->RunFor(2 * kSecond);
  EXPECT_EQ(state(), DisplayState::kShowing);
  EXPECT_TRUE(rig_->IsDark(0) && rig_->IsDark(1));
}

// A board that stayed still has its picture: it stays dark until all have the volume again.
TEST_F(Fadecandy, LightAfterALossInTheDarkIsWhole) {
  Start(2);
  Show();
  ASSERT_TRUE(rig_->display().SetBlank(true).ok());
  rig_->RunFor(kSecond);
  rig_->SetPlugged(1, false);
  rig_->RunFor(kSecond);
  EXPECT_EQ(state(), DisplayState::kLost);
  rig_->SetPlugged(1, true);
  rig_->RunFor(6 * kSecond);
  EXPECT_EQ(state(), DisplayState::kBlanked);
  EXPECT_TRUE(rig_->IsDark(0) && rig_->IsDark(1));
  bool torn = false;
  rig_->SetObserver([&] { torn |= rig_->IsDark(0) != rig_->IsDark(1); });
  ASSERT_TRUE(rig_->display().SetBlank(false).ok());
  rig_->RunFor(kSecond);
  EXPECT_TRUE(rig_->Sees(*frame_));
  EXPECT_FALSE(torn);
}

TEST_F(Fadecandy, StopDarkens) {
  Start(2);
  Show();
  rig_->display().Stop();
  rig_->clock().Advance(2 * kRefresh);
  for (size_t b = 0; b < 2; ++b) {
    EXPECT_FALSE(rig_->transport(b).is_open());
    rig_->transport(b).Pump();
    EXPECT_TRUE(rig_->IsDark(b));
  }
  // The picture that was shown before does not return.
  bool lit = false;
  rig_->SetObserver([&] { lit |= !rig_->IsDark(0) || !rig_->IsDark(1); });
  rig_->recorder().outcomes.clear();
  rig_->Start();
  rig_->RunFor(kSecond);
  EXPECT_FALSE(lit);
  EXPECT_EQ(state(), DisplayState::kShowing);
}

// ---- fades

TEST_F(Fadecandy, AFadeDoesNotLastAsLongAsThePauseBeforeIt) {
  Start(2, {.curve = {.gamma = 1}, .flags = kNoDither});
  Submit();
  ASSERT_TRUE(rig_->RunUntilOutcome(1));
  rig_->RunFor(5 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
  rig_->RunFor(30 * kSecond);
  Submit();
  ASSERT_TRUE(rig_->RunUntilOutcome(2));
  EXPECT_EQ(Newest().bytes_sent, 2 * 3200u);
  rig_->RunFor(5 * kRefresh);
  EXPECT_TRUE(rig_->Sees(*frame_));
  // Frame by frame, with 25 ms in between.
  rig_->RunFor(10 * kMillisecond);
  Submit();
  ASSERT_TRUE(rig_->RunUntilOutcome(3));
  EXPECT_EQ(Newest().bytes_sent, 2 * 1600u);
  rig_->RunFor(3 * kRefresh);
  EXPECT_FALSE(rig_->Sees(*frame_));
  rig_->RunFor(40 * kMillisecond);
  EXPECT_TRUE(rig_->Sees(*frame_));
}

// ---- captures

TEST_F(Fadecandy, CapturesWhatIsSent) {
  Start(3);
  Show();
  Show(0.3);
  std::optional<absl::StatusOr<DecodedVolume>> captured;
  const auto capture = [&] {
    captured.reset();
    rig_->display().Capture(kSecond,
                            [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
    ASSERT_TRUE(rig_->RunUntil([&] { return captured.has_value(); }));
    ASSERT_TRUE(captured->ok()) << captured->status();
    EXPECT_EQ((*captured)->Rgb(), FrameToRgb(*frame_));
    EXPECT_EQ((*captured)->volume, frame_->volume);
  };
  capture();
  Break(1, Fault::What::kStall);
  capture();
  EXPECT_EQ(stats().slices_resent, 1u);
  Break(2, Fault::What::kPartial, 640);
  Submit(0.2);
  capture();
}

TEST_F(Fadecandy, CapturesBlackBeforeTheFirstVolume) {
  Start(2);
  std::optional<absl::StatusOr<DecodedVolume>> captured;
  rig_->display().Capture(kSecond,
                          [&](absl::StatusOr<DecodedVolume> v) { captured = std::move(v); });
  ASSERT_TRUE(rig_->RunUntil([&] { return captured.has_value(); }));
  ASSERT_TRUE(captured->ok()) << captured->status();
  EXPECT_EQ((*captured)->Rgb(), std::vector<uint8_t>(2 * kFrameBytes));
  Show();
}

}  // namespace
}  // namespace voxeld::display::fadecandy
