#include "client/cpp/src/receipt_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

v1::Receipt Accepted(uint64_t frame, const std::vector<std::string>& displays) {
  v1::Receipt receipt;
  receipt.set_frame_id(frame);
  receipt.mutable_accepted();
  for (const std::string& name : displays) receipt.mutable_accepted()->add_displays(name);
  return receipt;
}

v1::Receipt OutcomeOf(uint64_t frame, const std::string& display) {
  v1::Receipt receipt;
  receipt.set_frame_id(frame);
  receipt.mutable_outcome()->set_display(display);
  return receipt;
}

v1::Receipt PresentedOn(uint64_t frame, const std::string& display) {
  v1::Receipt receipt = OutcomeOf(frame, display);
  receipt.mutable_outcome()->mutable_presented();
  return receipt;
}

class ReceiptBookTest : public testing::Test {
 protected:
  void Send(uint64_t frame, int64_t now) {
    book_.Queued(frame);
    book_.Sent(frame, frame * 10 - 5, frame * 10, now);
  }
  const Receipt& At(uint64_t frame) { return *book_.Find(frame); }

  ReceiptBook book_{true};
};

TEST_F(ReceiptBookTest, ACommitIsSettledByEveryOutcome) {
  Send(1, 1000);
  Send(2, 2000);
  EXPECT_EQ(book_.unsettled(), 2u);
  EXPECT_EQ(At(1).state, Receipt::State::kSent);
  EXPECT_EQ(book_.Find(9), nullptr);
  book_.Told(Accepted(1, {"a", "b"}), 1100);
  EXPECT_EQ(At(1).state, Receipt::State::kAccepted);
  EXPECT_EQ(book_.unsettled(), 2u);
  v1::Receipt outcome = PresentedOn(1, "a");
  outcome.mutable_outcome()->mutable_presented()->set_volume(7);
  outcome.mutable_outcome()->mutable_presented()->mutable_stages()->set_shown_ns(5);
  book_.Told(outcome, 1500);
  outcome = OutcomeOf(1, "b");
  outcome.mutable_outcome()->mutable_superseded()->set_by_frame_id(2);
  book_.Told(outcome, 1600);
  EXPECT_TRUE(At(1).settled);
  ASSERT_THAT(At(1).outcomes, SizeIs(2));
  EXPECT_EQ(At(1).outcomes[0].volume, 7u);
  EXPECT_EQ(At(1).outcomes[0].latency_ns, 500);
  EXPECT_EQ(At(1).outcomes[0].stages.shown_ns, 5);
  EXPECT_EQ(At(1).outcomes[1].by_frame, 2u);
  // An outcome may arrive before Accepted.
  outcome = OutcomeOf(2, "a");
  outcome.mutable_outcome()->mutable_lost()->set_reason("unplugged");
  book_.Told(outcome, 2500);
  EXPECT_EQ(book_.unsettled(), 1u);
  book_.Told(Accepted(2, {"a"}), 2600);
  EXPECT_EQ(book_.unsettled(), 0u);
  EXPECT_THAT(book_.TakeChanged(), ElementsAre(1, 2));
  EXPECT_THAT(book_.TakeChanged(), IsEmpty());
  // Answers for unknown commits change nothing.
  book_.Told(Accepted(77, {"a"}), 2700);
  EXPECT_THAT(book_.TakeChanged(), IsEmpty());

  const Tally tally = book_.GetTally();
  EXPECT_EQ(tally.commits, 2u);
  EXPECT_EQ(tally.accepted, 2u);
  EXPECT_EQ(tally.displays.at("a").presented, 1u);
  EXPECT_EQ(tally.displays.at("a").lost, 1u);
  EXPECT_EQ(tally.displays.at("a").last_lost_reason, "unplugged");
  EXPECT_EQ(tally.displays.at("b").superseded, 1u);
  EXPECT_THAT(book_.latencies_ns(), ElementsAre(500));
}

TEST_F(ReceiptBookTest, ServersWithoutDisplaysSettleAtOnceAndRefusalsAreKept) {
  Send(1, 0);
  book_.Told(Accepted(1, {}), 1);
  EXPECT_TRUE(At(1).settled);
  Send(2, 0);
  v1::Receipt refused;
  refused.set_frame_id(2);
  refused.mutable_refused()->set_message("no room");
  refused.mutable_refused()->set_refused_operations(3);
  book_.Told(refused, 1);
  EXPECT_EQ(book_.unsettled(), 0u);
  EXPECT_EQ(At(2).state, Receipt::State::kRefused);
  EXPECT_EQ(At(2).message, "no room");
  EXPECT_EQ(book_.GetTally().refused_operations, 3u);
}

TEST_F(ReceiptBookTest, WithoutOutcomesAcceptedIsAll) {
  ReceiptBook book(false);
  book.Queued(1);
  book.Sent(1, 1, 1, 0);
  book.Told(Accepted(1, {"a"}), 1);
  EXPECT_EQ(book.unsettled(), 0u);
}

TEST_F(ReceiptBookTest, IssuesBelongToTheCommitOfTheirSequence) {
  Send(1, 0);
  Send(2, 0);
  v1::Issue issue;
  issue.set_reason(v1::REASON_NOT_FOUND);
  issue.set_sequence(17);
  issue.set_message("no such");
  EXPECT_EQ(book_.Told(issue).frame, 2u);
  issue.set_sequence(11);  // belongs to no commit that was sent
  EXPECT_EQ(book_.Told(issue).frame, 0u);
  EXPECT_THAT(At(1).issues, IsEmpty());
  ASSERT_THAT(At(2).issues, SizeIs(1));
  EXPECT_EQ(At(2).issues[0].reason, Reason::kNotFound);
  EXPECT_EQ(ReasonName(At(2).issues[0].reason), "REASON_NOT_FOUND");
}

TEST_F(ReceiptBookTest, EverythingIsBounded) {
  v1::Issue issue;
  issue.set_reason(v1::REASON_NOT_FOUND);
  issue.set_sequence(10);
  Send(1, 0);
  for (int i = 0; i < 1000; ++i) book_.Told(issue);
  EXPECT_THAT(At(1).issues, SizeIs(ReceiptBook::kMostIssuesOfCommit));
  book_.Told(Accepted(1, {}), 0);
  EXPECT_EQ(book_.GetTally().issue_count, 1000u);
  EXPECT_EQ(book_.GetTally().not_found, 1000u);
  EXPECT_THAT(book_.GetTally().issues, SizeIs(ReceiptBook::kMostIssues));
  for (uint64_t frame = 2; frame <= ReceiptBook::kMostLatencies + 10; ++frame) {
    Send(frame, 0);
    book_.Told(PresentedOn(frame, "a"), static_cast<int64_t>(frame));
    book_.Told(Accepted(frame, {"a"}), 0);
    book_.TakeChanged();
  }
  EXPECT_THAT(book_.latencies_ns(), SizeIs(ReceiptBook::kMostLatencies));
  EXPECT_EQ(book_.latencies_ns()[8], static_cast<int64_t>(ReceiptBook::kMostLatencies + 10));
  uint64_t kept = 0;
  for (uint64_t frame = 1; frame <= ReceiptBook::kMostLatencies + 10; ++frame)
    kept += book_.Find(frame) == nullptr ? 0 : 1;
  EXPECT_EQ(kept, ReceiptBook::kMostSettled);
}

TEST_F(ReceiptBookTest, DropsAndLossesAreSaid) {
  book_.Queued(1);
  book_.Dropped(1, 2, false);
  EXPECT_EQ(At(1).client_dropped_frames, 2u);
  EXPECT_FALSE(At(1).settled);
  book_.Dropped(1, 1, true);
  EXPECT_EQ(At(1).state, Receipt::State::kDropped);
  Send(2, 0);
  book_.Told(Accepted(2, {"a", "b"}), 100);
  book_.Told(PresentedOn(2, "a"), 100);
  Send(3, 0);
  book_.StreamLost();
  EXPECT_EQ(At(3).state, Receipt::State::kQueued);
  EXPECT_EQ(book_.OutcomesLost(100, "gone"), 0u) << "it was not accepted before";
  EXPECT_EQ(book_.OutcomesLost(101, "gone"), 1u);
  ASSERT_THAT(At(2).outcomes, SizeIs(2));
  EXPECT_EQ(At(2).outcomes[1].display, "b");
  EXPECT_EQ(At(2).outcomes[1].kind, Outcome::Kind::kLost);
  EXPECT_EQ(At(2).outcomes[1].reason, "gone");
  book_.Sent(3, 50, 51, 0);
  EXPECT_EQ(At(3).sendings, 2u);
  book_.Applied(3, {});
  EXPECT_EQ(At(3).state, Receipt::State::kAccepted);
  book_.Queued(4);
  book_.Ended("the end");
  EXPECT_EQ(At(4).state, Receipt::State::kLost);
  EXPECT_EQ(At(4).message, "the end");
  const Tally tally = book_.GetTally();
  EXPECT_EQ(tally.commits, tally.accepted + tally.dropped + tally.lost);
  EXPECT_EQ(tally.client_dropped_frames, 3u);
  EXPECT_EQ(tally.unsettled, 0u);
}

TEST_F(ReceiptBookTest, WhatWasAppliedUnheardIsStillOwedItsOutcomes) {
  Send(1, 0);
  book_.StreamLost();
  book_.Applied(1, {"a", "b"});
  EXPECT_EQ(At(1).state, Receipt::State::kAccepted);
  EXPECT_FALSE(At(1).settled);
  book_.Told(PresentedOn(1, "b"), 100);
  EXPECT_FALSE(At(1).settled);
  EXPECT_EQ(book_.OutcomesLost(50, "gone"), 1u);
  ASSERT_THAT(At(1).outcomes, SizeIs(2));
  EXPECT_EQ(At(1).outcomes[0].kind, Outcome::Kind::kPresented);
  EXPECT_EQ(At(1).outcomes[1].kind, Outcome::Kind::kLost);
  ReceiptBook without(false);
  without.Queued(1);
  without.Sent(1, 1, 1, 0);
  without.Applied(1, {"a"});
  EXPECT_TRUE(without.Find(1)->settled);
}

TEST_F(ReceiptBookTest, WhatWasNotHeardOfIsToldByItsOutcomesOrLost) {
  for (const uint64_t frame : {1, 2}) {
    Send(frame, 0);
    book_.Unheard(frame, {"a"});
    EXPECT_EQ(At(frame).state, Receipt::State::kSent);
  }
  book_.StreamLost();
  EXPECT_EQ(At(1).state, Receipt::State::kSent) << "it does not wait here";
  book_.Told(PresentedOn(1, "a"), 100);
  EXPECT_EQ(At(1).state, Receipt::State::kAccepted);
  EXPECT_TRUE(At(1).settled);
  EXPECT_EQ(book_.OutcomesLost(50, "gone"), 1u);
  EXPECT_EQ(At(2).state, Receipt::State::kLost);
  EXPECT_EQ(At(2).message,
            "the answer was lost with its connection; the server applied it or refused it whole");
  EXPECT_THAT(At(2).outcomes, IsEmpty());
  EXPECT_EQ(book_.GetTally().accepted, 1u);
  EXPECT_EQ(book_.GetTally().lost, 1u);
  ReceiptBook without(false);
  without.Queued(1);
  without.Unheard(1, {"a"});
  EXPECT_EQ(without.Find(1)->state, Receipt::State::kLost) << "nothing would report it";
}

TEST_F(ReceiptBookTest, OutcomesOfAnEarlierSendingAreNotThoseOfTheNext) {
  Send(1, 0);
  book_.StreamLost();
  v1::Receipt old = PresentedOn(1, "a");
  old.set_sequence(10);
  book_.Told(old, 5);
  EXPECT_THAT(At(1).outcomes, IsEmpty()) << "it waits here";
  book_.Sent(1, 20, 21, 6);
  book_.Told(old, 7);
  EXPECT_THAT(At(1).outcomes, IsEmpty());
  EXPECT_EQ(book_.GetTally().displays.at("a").presented, 2u);
  book_.Told(Accepted(1, {"a"}), 8);
  v1::Receipt outcome = PresentedOn(1, "a");
  outcome.set_sequence(21);
  book_.Told(outcome, 9);
  EXPECT_TRUE(At(1).settled);
}

TEST_F(ReceiptBookTest, IssuesMayComeBeforeTheCommitIsSent) {
  book_.Queued(1);
  v1::Issue issue;
  issue.set_sequence(5);
  EXPECT_EQ(book_.Told(issue, 1).frame, 1u);
  EXPECT_THAT(At(1).issues, SizeIs(1));
  book_.Sent(1, 5, 6, 0);
  EXPECT_THAT(At(1).issues, SizeIs(1));
  book_.StreamLost();
  book_.Sent(1, 8, 9, 0);
  EXPECT_THAT(At(1).issues, IsEmpty()) << "it will be reported again";
}

TEST_F(ReceiptBookTest, TimedCommitsAreScheduledFirst) {
  Send(1, 0);
  v1::Receipt scheduled;
  scheduled.set_frame_id(1);
  scheduled.mutable_scheduled()->set_present_at_ns(77);
  book_.Told(scheduled, 1);
  EXPECT_EQ(At(1).state, Receipt::State::kScheduled);
  EXPECT_EQ(At(1).present_at_ns, 77);
  v1::Receipt accepted = Accepted(1, {});
  accepted.mutable_accepted()->set_late(true);
  accepted.mutable_accepted()->set_dropped_frames(2);
  book_.Told(accepted, 2);
  EXPECT_TRUE(At(1).late);
  EXPECT_EQ(book_.GetTally().server_dropped_frames, 2u);
}

}  // namespace
}  // namespace voxeld::client
