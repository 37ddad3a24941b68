// Tests the judges of outcomes and pictures: they accept what is right, and report what is wrong.
#include "tests/simulation/outcome_judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace voxeld::simulation {
namespace {

using daemon::Receipt;
using display::DisplayState;
using Kind = CommitOutcome::Kind;
using ::testing::HasSubstr;

constexpr Look kBlack = 1, kRed = 2, kBlue = 3;

TEST(Eye, SeesWhatWasDrawnAndNothingElse) {
  Eye eye(kBlack);
  EXPECT_EQ(eye.Sees(kBlack, 5), "") << "black before anything was shown is for a capture";
  eye.Asked(1, 10, false, 6);
  EXPECT_THAT(eye.Sees(kRed, 7), HasSubstr("never drawn"));
  eye.Drew(1, kRed, 10, 10, 8);
  EXPECT_EQ(eye.Sees(kRed, 9), "");
  EXPECT_THAT(eye.Sees(kBlack, 10), HasSubstr("never drawn"));
}

TEST(Eye, GoesNotBack) {
  Eye eye(kBlack);
  eye.Asked(1, 10, false, 1);
  eye.Drew(1, kRed, 10, 10, 2);
  eye.Asked(2, 11, false, 3);
  eye.Drew(2, kBlue, 11, 11, 4);
  EXPECT_EQ(eye.Sees(kBlue, 5), "");
  EXPECT_THAT(eye.Sees(kRed, 6), HasSubstr("shows volume 1 again"));
  eye.Asked(3, 12, false, 7);
  eye.Drew(3, kRed, 12, 12, 8);
  EXPECT_EQ(eye.Sees(kRed, 9), "") << "a newer volume that looks like an older one";
}

class OutcomeJudgeTest : public ::testing::Test {
 protected:
  // A commit of session 1 in that snapshot, applied at that time, and taken by a display that is
  // showing.
  void Commit(uint64_t sequence, uint64_t snapshot, sync::TimeNs now, sync::TimeNs present_at = 0) {
    judge_.OnApplied({1, 0, sequence, sequence, snapshot, true, false, present_at}, now);
    judge_.Pictured(snapshot, snapshot);
    judge_.Boards(0, state_);
    judge_.Boarded(0, state_);
  }
  void Draw(uint64_t volume, uint64_t snapshot, Look look, sync::TimeNs now) {
    judge_.screen(0).eye.Asked(volume, snapshot, false, now);
    judge_.screen(0).eye.Drew(volume, look, snapshot, snapshot, now);
  }
  std::string Tell(uint64_t sequence, CommitOutcome outcome, sync::TimeNs now) {
    outcome.display = "main";
    return judge_.Told(1, Receipt{sequence, sequence, outcome, 0}, outcome, now);
  }
  static CommitOutcome Presented(uint64_t volume, sync::TimeNs at) {
    CommitOutcome outcome;
    outcome.kind = Kind::kPresented;
    outcome.volume = volume;
    outcome.time_ns = at;
    return outcome;
  }
  static CommitOutcome Of(Kind kind, uint64_t number = 0) {
    CommitOutcome outcome;
    outcome.kind = kind;
    outcome.volume = outcome.by_sequence = outcome.by_frame_id = number;
    return outcome;
  }

  OutcomeJudge judge_{
      {{.name = "main", .eye = Eye(kBlack), .disturbed_until = -1, .tolerance = 1}}};
  DisplayState state_ = DisplayState::kShowing;
};

TEST_F(OutcomeJudgeTest, PresentedIsWhatWasShownThen) {
  Commit(1, 2, 100);
  EXPECT_THAT(Tell(1, Presented(7, 130), 130), HasSubstr("not drawn"));
  Commit(2, 3, 100);
  Draw(8, 3, kRed, 110);
  EXPECT_THAT(Tell(2, Presented(8, 130), 130), HasSubstr("nothing like it was shown"));
  Commit(3, 4, 140);
  Draw(9, 4, kBlue, 150);
  ASSERT_EQ(judge_.screen(0).eye.Sees(kBlue, 160), "");
  EXPECT_EQ(Tell(3, Presented(9, 160), 160), "");
  EXPECT_THAT(Tell(3, Presented(9, 160), 160), HasSubstr("told twice"));
}

TEST_F(OutcomeJudgeTest, PresentedIsTheFirstThatHoldsIt) {
  Commit(1, 2, 100);
  Draw(1, 2, kRed, 110);
  ASSERT_EQ(judge_.screen(0).eye.Sees(kRed, 120), "");
  Commit(2, 3, 130);
  EXPECT_THAT(Tell(2, Presented(1, 120), 140), HasSubstr("older"));
  Draw(2, 3, kBlue, 150);
  ASSERT_EQ(judge_.screen(0).eye.Sees(kBlue, 160), "");
  EXPECT_THAT(Tell(1, Presented(2, 160), 160), HasSubstr("an earlier one with it was shown"));
}

TEST_F(OutcomeJudgeTest, ATimedOneIsNotPresentedBeforeItsTime) {
  Commit(1, 2, 100, /*present_at=*/200);
  Draw(1, 2, kRed, 110);
  ASSERT_EQ(judge_.screen(0).eye.Sees(kRed, 120), "");
  EXPECT_THAT(Tell(1, Presented(1, 120), 120), HasSubstr("before its time"));
}

TEST_F(OutcomeJudgeTest, LostOnlyWhereSomethingIsAmiss) {
  Commit(1, 2, 100);
  EXPECT_THAT(Tell(1, Of(Kind::kLost), 110), HasSubstr("nothing has disturbed"));
  judge_.Disturb(0, 120);
  Commit(2, 3, 119);
  EXPECT_EQ(Tell(2, Of(Kind::kLost), 500), "");
  Commit(3, 4, 121);
  EXPECT_THAT(Tell(3, Of(Kind::kLost), 500), HasSubstr("nothing has disturbed"));
}

TEST_F(OutcomeJudgeTest, NotShownAsTheDisplayWasWhenItTookIt) {
  state_ = DisplayState::kBlanked;
  Commit(1, 2, 100);
  Commit(2, 3, 100);
  state_ = DisplayState::kShowing;
  Commit(3, 4, 100);
  CommitOutcome blanked = Of(Kind::kNotShown);
  blanked.why = CommitOutcome::NotShown::kBlanked;
  EXPECT_EQ(Tell(1, blanked, 110), "");
  EXPECT_THAT(Tell(2, Presented(1, 110), 110), HasSubstr("not to be shown"));
  EXPECT_THAT(Tell(3, blanked, 110), HasSubstr("may not be"));
}

TEST_F(OutcomeJudgeTest, SupersededByALaterOneOfTheSameVolume) {
  Commit(1, 2, 100);
  Commit(2, 3, 101);
  EXPECT_EQ(Tell(1, Of(Kind::kSuperseded, 2), 110), "");
  EXPECT_THAT(Tell(2, Of(Kind::kSuperseded, 1), 110), HasSubstr("no later commit"));
  Commit(3, 4, 120);
  Draw(1, 4, kRed, 121);
  ASSERT_EQ(judge_.screen(0).eye.Sees(kRed, 122), "");
  Commit(4, 5, 130);
  EXPECT_THAT(Tell(3, Of(Kind::kSuperseded, 4), 140), HasSubstr("rode later"));
}

TEST_F(OutcomeJudgeTest, UnchangedFromWhatLooksTheSame) {
  Draw(1, 1, kRed, 90);
  ASSERT_EQ(judge_.screen(0).eye.Sees(kRed, 95), "");
  Commit(1, 2, 100);
  Draw(2, 2, kRed, 101);
  EXPECT_EQ(Tell(1, Of(Kind::kUnchanged, 1), 110), "");
  Commit(2, 3, 120);
  Draw(3, 3, kBlue, 121);
  EXPECT_THAT(Tell(2, Of(Kind::kUnchanged, 1), 130), HasSubstr("looks otherwise"));
  Commit(3, 4, 140);
  EXPECT_THAT(Tell(3, Of(Kind::kUnchanged, 3), 150), HasSubstr("was not shown"));
}

TEST_F(OutcomeJudgeTest, WhatIsNotToldIsMissing) {
  Commit(1, 2, 100);
  std::string which;
  EXPECT_EQ(judge_.Missing(1, 0, &which), 1u);
  EXPECT_EQ(which, "session 1 sequence 1 on main");
  judge_.Disturb(0, 200);
  EXPECT_EQ(Tell(1, Of(Kind::kLost), 110), "");
  EXPECT_EQ(judge_.Missing(1, 0, &which), 0u);
  EXPECT_EQ(judge_.owed(), judge_.told());
}

}  // namespace
}  // namespace voxeld::simulation
