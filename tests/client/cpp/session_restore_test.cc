// Tests what a session knows of its state after it lost its connection: what was applied but not
// reported, what was refused, and what is inserted again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/client/cpp/fake_transport.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const absl::Status kGone = absl::UnavailableError("broken pipe");

using Kind = ConnectionChange::Kind;

class Restore : public testing::Test {
 protected:
  Options Make() {
    Options options;
    options.ping_interval = Duration(0);
    options.on_disconnect = OnDisconnect::kKeep;
    options.on_connection = [this](const ConnectionChange& change) { changes_.push_back(change); };
    options.on_issue = [this](const Issue& issue) { issues_.push_back(issue); };
    return options;
  }
  static v1::Opened OpenedAgain(uint64_t last_sequence) {
    v1::Opened opened;
    opened.set_resume_token("again");
    opened.set_last_sequence(last_sequence);
    opened.add_displays("sim");
    return opened;
  }
  static void Resume(SessionUnderTest& session, uint64_t last_sequence) {
    session.End(kGone);
    session.Advance(10 * sync::kSecond);
    session.TakeWords();
    session.SayOpened(OpenedAgain(last_sequence));
  }
  // The server has forgotten the session. Returns what it is sent then.
  static std::vector<std::string> BeginAnew(SessionUnderTest& session) {
    session.End(kGone);
    session.Advance(10 * sync::kSecond);
    session.End(absl::NotFoundError("no such session"));
    session.TakeWords();
    session.SayOpened();
    return session.TakeWords();
  }
  static uint64_t SequenceOfCommit(SessionUnderTest& session, uint64_t frame) {
    for (const v1::StreamRequest& request : session.stream().written) {
      if (request.has_commit() && request.commit().frame_id() == frame) return request.sequence();
    }
    ADD_FAILURE() << "commit " << frame << " was not sent";
    return 0;
  }

  std::vector<ConnectionChange> changes_;
  std::vector<Issue> issues_;
};

TEST_F(Restore, OutcomesOfWhatWasAppliedUnheardAreStillOwed) {
  SessionUnderTest session(Make());
  session.SayOpened();
  session.Put("a");
  Resume(session, SequenceOfCommit(session, 1));
  EXPECT_THAT(session.TakeWords(), SizeIs(0)) << "nothing is sent again";
  EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kAccepted);
  EXPECT_TRUE(absl::IsDeadlineExceeded(session->WaitShown(1, Duration(0)).status()));
  session.SayPresented(1, "sim");
  const absl::StatusOr<Receipt> shown = session->WaitShown(1, Duration(0));
  ASSERT_TRUE(shown.ok()) << shown.status();
  ASSERT_THAT(shown->outcomes, SizeIs(1));
  EXPECT_EQ(shown->outcomes[0].kind, Outcome::Kind::kPresented);
}

TEST_F(Restore, OutcomesOfWhatWasAppliedUnheardMayBeLostAsWell) {
  SessionUnderTest session(Make());
  session.SayOpened();
  session.Put("a");
  Resume(session, SequenceOfCommit(session, 1));
  session.Advance(12 * sync::kSecond);
  ASSERT_TRUE(session->FindReceipt(1)->settled);
  EXPECT_EQ(session->FindReceipt(1)->outcomes.at(0).kind, Outcome::Kind::kLost);
}

// 1 is refused and 2 accepted, and the client receives neither answer.
TEST_F(Restore, ARefusalThatWasNotHeardIsNotTakenForAccepted) {
  Options options = Make();
  options.strict = true;
  SessionUnderTest session(options);
  session.SayOpened();
  session.Put("refused");
  session.Put("accepted");
  Resume(session, SequenceOfCommit(session, 2));
  EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kSent);
  EXPECT_EQ(session->FindReceipt(2)->state, Receipt::State::kAccepted);
  session.SayPresented(2, "sim");
  session.Advance(12 * sync::kSecond);
  EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kLost);
  EXPECT_THAT(session->FindReceipt(1)->message, HasSubstr("applied it or refused it whole"));
  EXPECT_EQ(session->GetTally().accepted, 1u);
  EXPECT_THAT(BeginAnew(session), ElementsAre("layer l", "l/accepted", "commit 3"));
}

TEST_F(Restore, AnOutcomeTellsThatWhatWasNotHeardWasApplied) {
  Options options = Make();
  options.strict = true;
  SessionUnderTest session(options);
  session.SayOpened();
  for (const char* id : {"a", "b", "a"}) session.Put(id);
  Resume(session, SequenceOfCommit(session, 3));
  session.SayPresented(2, "sim");
  EXPECT_EQ(session->FindReceipt(2)->state, Receipt::State::kAccepted);
  session.SayPresented(1, "sim");
  session.SayPresented(3, "sim");
  EXPECT_TRUE(session->WaitSettled(Duration(0)).ok());
  EXPECT_EQ(session->GetTally().accepted, 3u);
  // In the order of the commits, not that of the outcomes.
  EXPECT_THAT(BeginAnew(session), ElementsAre("layer l", "l/b l/a", "commit 4"));
}

TEST_F(Restore, WithoutStrictnessEveryOneBeforeTheLastWasAccepted) {
  SessionUnderTest session(Make());
  session.SayOpened();
  session.Put("a");
  session.Put("b");
  // Answers from before the disconnect count.
  session.SayIssue(1, "l", "a");
  Resume(session, SequenceOfCommit(session, 2));
  EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kAccepted);
  EXPECT_EQ(session->FindReceipt(2)->state, Receipt::State::kAccepted);
  EXPECT_THAT(BeginAnew(session), ElementsAre("layer l", "l/b", "commit 3"));
}

TEST_F(Restore, ARefusedMoveLeavesWhatWasPutUpInTheSameCommit) {
  SessionUnderTest session(Make());
  session.SayOpened();
  ASSERT_TRUE(session->StageUpsert("l", "a", Sphere{}, {}).ok());
  ASSERT_TRUE(session->Stage(TransformOperation{"l", "a", Affine::Scale(0)}).ok());
  ASSERT_TRUE(session->Commit(nullptr, {}).ok());
  session.Settle();
  session.SayIssue(2, "l", "a");
  EXPECT_EQ(issues_.at(0).frame, 1u);
  session.SayAccepted(1);
  EXPECT_THAT(BeginAnew(session), ElementsAre("layer l", "l/a", "commit 2"));
  EXPECT_FALSE(session.stream().written[2].batch().upserts(0).entity().has_transform());
}

TEST_F(Restore, EveryIssueCountsHoweverManyThereAre) {
  SessionUnderTest session(Make());
  session.SayOpened();
  for (int i = 0; i < 1000; ++i)
    ASSERT_TRUE(session->StageUpsert("l", std::to_string(i), Sphere{}, {}).ok());
  ASSERT_TRUE(session->Commit(nullptr, {}).ok());
  session.Settle();
  v1::StreamResponse response;
  for (int i = 0; i < 999; ++i) {
    v1::Issue* issue = response.add_issues();
    issue->set_sequence(session.stream().written[1].sequence());
    issue->set_layer("l");
    issue->set_id(std::to_string(i));
  }
  session.Say(response);
  session.SayAccepted(1);
  EXPECT_THAT(BeginAnew(session), ElementsAre("layer l", "l/999", "commit 2"));
}

TEST_F(Restore, AnIssueMayComeBeforeItsCommitIsSent) {
  SessionUnderTest session(Make());
  session.SayOpened(session.stream().bytes + 1);
  ASSERT_TRUE(session->StageUpsert("l", "bad", Sphere{}, {}).ok());
  ASSERT_TRUE(session->Commit(nullptr, {}).ok());
  session.Settle();
  ASSERT_THAT(session.TakeWords(), ElementsAre("open", "l/bad"));
  session.SayIssue(1, "l", "bad");
  EXPECT_EQ(session->FindReceipt(1)->issues.size(), 1u);
  v1::StreamResponse credit;
  credit.set_credit_bytes(1 << 20);
  session.Say(credit);
  session.SayAccepted(1);
  EXPECT_EQ(session->FindReceipt(1)->issues.size(), 1u);
  EXPECT_THAT(BeginAnew(session), SizeIs(0));
}

TEST_F(Restore, AnUnansweredRestoreIsNotAddedToTheNext) {
  SessionUnderTest session(Make());
  session.SayOpened();
  session.Put("a");
  session.SayAccepted(1);
  for (uint64_t round = 2; round < 10; ++round) {
    EXPECT_THAT(BeginAnew(session),
                ElementsAre("layer l", "l/a", "commit " + std::to_string(round)));
  }
  // When it is resumed with its layers, the session continues, and is not restored from the start.
  Resume(session, 0);
  EXPECT_THAT(session.TakeWords(), ElementsAre("layer l", "l/a", "commit 9"));
}

TEST_F(Restore, WhatIsRestoredInPartKeepsItsOrder) {
  SessionUnderTest session(Make());
  v1::Opened opened;
  opened.mutable_limits()->set_max_operations_per_commit(2);
  session.SayOpened(opened);
  for (const char* id : {"a", "b", "c"}) session.Put(id);
  for (const uint64_t frame : {1, 2, 3}) session.SayAccepted(frame);
  const auto begin_anew = [&] {
    session.End(kGone);
    session.Advance(10 * sync::kSecond);
    session.TakeWords();
    session.SayOpened(opened);
    return session.TakeWords();
  };
  EXPECT_THAT(begin_anew(), ElementsAre("layer l", "l/a", "commit 4", "l/b l/c", "commit 5"));
  session.SayAccepted(4);
  EXPECT_THAT(begin_anew(), ElementsAre("layer l", "l/a", "commit 6", "l/b l/c", "commit 7"));
}

TEST_F(Restore, WithoutRestoringNothingIsSaidToBeRestored) {
  Options options = Make();
  options.restore = false;
  SessionUnderTest session(options);
  session.SayOpened();
  session.Put("a");
  session.SayAccepted(1, {"sim"});
  session.Put("b");
  EXPECT_THAT(BeginAnew(session), ElementsAre("l/b", "commit 2"));
  ASSERT_THAT(changes_, SizeIs(3));
  EXPECT_EQ(changes_.back().kind, Kind::kReopened);
  EXPECT_EQ(changes_.back().lost_outcomes, 1u);
  EXPECT_EQ(session->GetTally().restored, 0u);
}

TEST_F(Restore, AnOwnerThatWasJoinedAndIsGoneIsReplacedByANewOne) {
  Options options = Make();
  options.owner_token = "shared";
  SessionUnderTest session(options);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open owner shared"));
  v1::Opened opened;
  opened.set_resume_token("r");
  opened.set_owner_token("shared");
  session.SayOpened(opened);
  session.Put("a");
  session.SayAccepted(1);
  session.End(kGone);
  session.Advance(sync::kSecond);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open resume r"));
  session.End(absl::NotFoundError("the daemon is another one"));
  EXPECT_THAT(session.TakeWords(), ElementsAre("open owner shared"));
  session.End(absl::NotFoundError("and knows no such owner"));
  ASSERT_THAT(session.TakeWords(), ElementsAre("open"));
  opened.set_owner_token("new");
  session.SayOpened(opened);
  EXPECT_THAT(session.TakeWords(), ElementsAre("layer l", "l/a", "commit 2"));
  EXPECT_EQ(session->server()->owner_token, "new");
  EXPECT_EQ(changes_.back().kind, Kind::kRestored);
}

TEST_F(Restore, AnOwnerThatNeverWasThereEndsTheSession) {
  Options options = Make();
  options.owner_token = "wrong";
  SessionUnderTest session(options);
  session.End(absl::NotFoundError("no such owner"));
  EXPECT_TRUE(absl::IsNotFound(session->WaitOpened(Duration(0))));
  EXPECT_EQ(session.started(), 1u);
}

}  // namespace
}  // namespace voxeld::client
