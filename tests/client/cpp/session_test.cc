// Tests one connection of a session: what is sent when, and what is reported.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "tests/client/cpp/fake_transport.h"

namespace voxeld::client {
namespace session_test {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;

constexpr Duration kAtOnce{0};

Options Quiet() {
  Options options;
  options.ping_interval = Duration(0);
  return options;
}

std::string MessageOf(const absl::Status& status) { return std::string(status.message()); }

TEST(Session, NothingGoesBeforeOpened) {
  SessionUnderTest session(Quiet());
  session.Put("a");
  session.Put("b");
  EXPECT_THAT(session.TakeWords(), ElementsAre("open"));
  EXPECT_LE(session.stream().bytes, 48u << 10);
  EXPECT_FALSE(session->server().has_value());
  EXPECT_TRUE(absl::IsDeadlineExceeded(session->WaitOpened(kAtOnce)));
  session.SayOpened();
  EXPECT_THAT(session.TakeWords(), ElementsAre("l/a", "commit 1", "l/b", "commit 2"));
  EXPECT_TRUE(session->WaitOpened(kAtOnce).ok());
  EXPECT_THAT(session->server()->displays, ElementsAre("sim"));
}

TEST(Session, OpenSaysWhatTheOptionsSay) {
  Options options = Quiet();
  options.client_name = "me";
  options.on_disconnect = OnDisconnect::kLinger;
  options.linger = std::chrono::seconds(3);
  options.strict = true;
  options.outcomes = false;
  options.flow = Flow::kDropOldest;
  options.drop_oldest_frames = 7;
  options.owner_token = "shared";
  SessionUnderTest session(options);
  const v1::Open& open = session.stream().written[0].open();
  EXPECT_EQ(open.client_name(), "me");
  EXPECT_EQ(open.on_disconnect(), v1::DISCONNECT_POLICY_LINGER);
  EXPECT_EQ(open.linger_ns(), 3'000'000'000);
  EXPECT_TRUE(open.strict());
  EXPECT_TRUE(open.no_outcomes());
  EXPECT_EQ(open.flow(), v1::FLOW_POLICY_DROP_OLDEST);
  EXPECT_EQ(open.drop_oldest_frames(), 7u);
  EXPECT_EQ(open.owner_token(), "shared");
}

TEST(Session, CreditIsKeptToTheByte) {
  SessionUnderTest session(Quiet());
  session.Put("a");
  const uint64_t open_bytes = session.stream().bytes;
  session.SayOpened(open_bytes + 1);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open", "l/a"));
  EXPECT_FALSE(session->HasRoom());
  v1::StreamResponse credit;
  credit.set_credit_bytes(session.stream().bytes);
  session.Say(credit);
  EXPECT_THAT(session.TakeWords(), IsEmpty());
  credit.set_credit_bytes(session.stream().bytes + 1);
  session.Say(credit);
  EXPECT_THAT(session.TakeWords(), ElementsAre("commit 1"));
  EXPECT_FALSE(session->HasRoom()) << "the credit is used up";
  EXPECT_EQ(MessageOf(session->WaitForRoom(kAtOnce)),
            "waited in vain for room from voxeld at there:1");
  credit.set_credit_bytes(1 << 20);
  session.Say(credit);
  EXPECT_TRUE(session->HasRoom());
  EXPECT_TRUE(session->WaitForRoom(kAtOnce).ok());
  EXPECT_EQ(session->GetTally().bytes_sent, session.stream().bytes);
}

TEST(Session, CommitsCarryTheirTimeAndReceiptsComeBack) {
  std::vector<std::string> told;
  Options options = Quiet();
  SessionUnderTest* self = nullptr;
  options.on_receipt = [&](const Receipt& receipt) {
    told.push_back(absl::StrCat(receipt.frame, ":", static_cast<int>(receipt.state),
                                receipt.settled ? "!" : ""));
    // Callbacks may call the session.
    EXPECT_TRUE((*self)->FindReceipt(receipt.frame).has_value());
    EXPECT_TRUE((*self)->StageUpsert("l", "again", Sphere{}, {}).ok());
  };
  SessionUnderTest session(options);
  self = &session;
  session.SayOpened();
  session.clock().Advance(5000);
  const uint64_t frame = session.Put("a");
  EXPECT_EQ(session.stream().written.back().commit().send_time_ns(), session.clock().Now());
  EXPECT_TRUE(absl::IsDeadlineExceeded(session->WaitAccepted(frame, kAtOnce).status()));
  session.SayAccepted(frame, {"sim"});
  EXPECT_TRUE(session->WaitAccepted(frame, kAtOnce).ok());
  EXPECT_TRUE(absl::IsDeadlineExceeded(session->WaitShown(frame, kAtOnce).status()));
  EXPECT_EQ(MessageOf(session->WaitSettled(kAtOnce)), "1 commit has no outcome yet");
  session.clock().Advance(300);
  v1::StreamResponse response;
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(frame);
  receipt->mutable_outcome()->set_display("sim");
  receipt->mutable_outcome()->mutable_presented()->set_volume(4);
  session.Say(response);
  const absl::StatusOr<Receipt> shown = session->WaitShown(frame, kAtOnce);
  ASSERT_TRUE(shown.ok());
  EXPECT_EQ(shown->outcomes[0].volume, 4u);
  EXPECT_THAT(session->latencies_ns(), ElementsAre(300));
  EXPECT_TRUE(session->WaitSettled(kAtOnce).ok());
  EXPECT_THAT(told, ElementsAre("1:0", "1:1", "1:3", "1:3!"));
  EXPECT_TRUE(absl::IsNotFound(session->WaitAccepted(99, kAtOnce).status()));
}

TEST(Session, ARefusalIsToldWithItsIssues) {
  std::vector<Issue> told;
  Options options = Quiet();
  options.on_issue = [&](const Issue& issue) { told.push_back(issue); };
  SessionUnderTest session(options);
  session.SayOpened();
  const uint64_t frame = session.Put("a");
  v1::StreamResponse response;
  v1::Issue* issue = response.add_issues();
  issue->set_sequence(session.stream().written[1].sequence());
  issue->set_layer("l");
  issue->set_id("a");
  issue->set_message("radius is −1; more than 0 is right");
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(frame);
  receipt->mutable_refused()->set_message("one operation was refused");
  session.Say(response);
  const absl::Status status = session->WaitAccepted(frame, kAtOnce).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_EQ(MessageOf(status),
            "the server refused commit 1: one operation was refused\n"
            "  l/a: radius is −1; more than 0 is right");
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0].frame, frame);
}

TEST(Session, LatestGivesUpFramesWithoutCreditAndSaysSo) {
  Options options = Quiet();
  options.flow = Flow::kLatest;
  SessionUnderTest session(options);
  session.SayOpened(1);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(session.DrawFrame("f").ok());
  EXPECT_THAT(session.TakeWords(), ElementsAre("open"));
  EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kDropped);
  EXPECT_EQ(MessageOf(session->WaitShown(4, kAtOnce).status()),
            "the commit 4 was not sent: newer frames replaced its own");
  v1::StreamResponse credit;
  credit.set_credit_bytes(1 << 20);
  session.Say(credit);
  EXPECT_THAT(session.TakeWords(), ElementsAre("begin f", "f/x", "end f", "commit 5"));
  EXPECT_EQ(session.stream().written.back().commit().client_drops(), 4u);
  EXPECT_EQ(session->GetTally().client_dropped_frames, 4u);
  EXPECT_EQ(session->GetTally().dropped, 4u);
}

TEST(Session, AFullBufferKeepsWhatIsStaged) {
  Options options = Quiet();
  options.buffer_bytes = 400;
  SessionUnderTest session(options);
  session.SayOpened(1);
  session.Put("a");
  ASSERT_TRUE(
      session->StageUpsert("l", "b", Points{.vertices = {.positions = std::vector<float>(90)}}, {})
          .ok());
  const size_t staged = session->staged_bytes();
  EXPECT_TRUE(absl::IsResourceExhausted(session->Commit(nullptr, {}).status()));
  EXPECT_EQ(session->staged_bytes(), staged);
  v1::StreamResponse credit;
  credit.set_credit_bytes(1 << 20);
  session.Say(credit);
  session.TakeWords();
  EXPECT_EQ(*session->Commit(nullptr, {}), 2u) << "no number is skipped";
  session.Settle();
  EXPECT_THAT(session.TakeWords(), ElementsAre("l/b", "commit 2"));
}

TEST(Session, WhatIsLargerThanAMessageIsRefusedHere) {
  SessionUnderTest session(Quiet());
  v1::Opened opened;
  opened.mutable_limits()->set_max_message_bytes(10'000);
  session.SayOpened(opened);
  const absl::Status status = session->StageUpsert(
      "l", "a", Points{.vertices = {.positions = std::vector<float>(3'000)}}, {});
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(MessageOf(status), HasSubstr("max_message_bytes is 10000"));
  EXPECT_EQ(session->staged_bytes(), 0u);
}

TEST(Session, CloseSendsWhatWaitsThenHalfCloses) {
  SessionUnderTest session(Quiet());
  session.SayOpened(1);
  session.Put("a");
  EXPECT_THAT(
      MessageOf(session->Close(kAtOnce)),
      MatchesRegex("voxeld at there:1 did not end the stream in 0 s; [1-9][0-9]* bytes were "
                   "not sent"));
  EXPECT_FALSE(session.stream().half_closed);
  EXPECT_TRUE(absl::IsFailedPrecondition(session->Commit(nullptr, {}).status()));
  v1::StreamResponse credit;
  credit.set_credit_bytes(1 << 20);
  session.Say(credit);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open", "l/a", "commit 1"));
  EXPECT_TRUE(session.stream().half_closed);
  session.SayAccepted(1);
  session.End(absl::OkStatus());
  EXPECT_TRUE(session->Close(kAtOnce).ok());
  EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kAccepted);
}

TEST(Session, InterruptEndsWaitsButNotTheLast) {
  SessionUnderTest session(Quiet());
  session->Interrupt();
  const Duration forever = std::chrono::hours(1000);
  EXPECT_TRUE(absl::IsCancelled(session->WaitOpened(forever)));
  EXPECT_TRUE(absl::IsCancelled(session->WaitForRoom(forever)));
  EXPECT_TRUE(session->WaitSettled(forever).ok()) << "there is nothing to wait for";
}

TEST(Session, PingsEstimateTheClock) {
  SessionUnderTest session;
  session.SayOpened();
  EXPECT_THAT(session.TakeWords(), Contains("ping"));
  EXPECT_FALSE(session->ServerNow().has_value());
  const int64_t sent = session.stream().written.back().ping().client_time_ns();
  EXPECT_EQ(sent, session.clock().Now());
  session.clock().Advance(100);
  v1::StreamResponse response;
  response.mutable_pong()->set_client_time_ns(sent);
  response.mutable_pong()->set_received_time_ns(sent + 50 + 1'000'000);
  response.mutable_pong()->set_server_time_ns(sent + 50 + 1'000'000);
  session.Say(response);
  EXPECT_EQ(session->clock_estimate()->offset_ns, 1'000'000);
  EXPECT_EQ(session->clock_estimate()->round_trip_ns, 100);
  EXPECT_EQ(*session->ServerNow(), session.clock().Now() + 1'000'000);
}

}  // namespace session_test
}  // namespace voxeld::client
