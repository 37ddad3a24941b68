// Tests a session that loses its connection.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/client/cpp/fake_transport.h"

namespace voxeld::client {
namespace session_reconnect_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr Duration kAtOnce{0};
const absl::Status kGone = absl::UnavailableError("broken pipe");

using Kind = ConnectionChange::Kind;

class Reconnect : public testing::Test {
 protected:
  Options Make() {
    Options options;
    options.ping_interval = Duration(0);
    options.on_disconnect = OnDisconnect::kLinger;
    options.linger = std::chrono::seconds(5);
    options.on_connection = [this](const ConnectionChange& change) {
      changes_.push_back(change.kind);
      last_ = change;
    };
    return options;
  }
  static v1::Opened OpenedAgain(std::optional<uint64_t> last_sequence = {}) {
    v1::Opened opened;
    opened.set_resume_token("token2");
    if (last_sequence) opened.set_last_sequence(*last_sequence);
    return opened;
  }

  std::vector<Kind> changes_;
  ConnectionChange last_;
};

TEST_F(Reconnect, PausesGrowAndBeginAnewAfterASuccess) {
  SessionUnderTest session(Make());
  EXPECT_EQ(session.started(), 1u);
  for (const int64_t pause : {100, 200, 400, 800, 1600, 3200, 5000, 5000}) {
    const uint64_t before = session.started();
    session.End(kGone);
    session.Advance(pause * sync::kMillisecond - 1);
    EXPECT_EQ(session.started(), before);
    session.Advance(1);
    EXPECT_EQ(session.started(), before + 1) << pause;
  }
  EXPECT_THAT(session->WaitOpened(kAtOnce).message(),
              HasSubstr("voxeld at there:1 is not available: broken pipe"));
  session.SayOpened();
  session.Put("a");
  session.SayAccepted(1);
  session.End(kGone);
  uint64_t before = session.started();
  session.Advance(100 * sync::kMillisecond);
  EXPECT_EQ(session.started(), before + 1);
  EXPECT_THAT(changes_, ElementsAre(Kind::kOpened, Kind::kLost));
  // A stream that ends again without an answer does not count as a success, unless it lasted.
  for (const int64_t pause : {200, 400}) {
    session.SayOpened();
    session.Put("a");
    before = session.started();
    session.End(absl::ResourceExhaustedError("too large"));
    session.Advance(pause * sync::kMillisecond - 1);
    EXPECT_EQ(session.started(), before);
    session.Advance(1);
    EXPECT_EQ(session.started(), before + 1) << pause;
  }
  session.SayOpened();
  session.Advance(5 * sync::kSecond);
  before = session.started();
  session.End(kGone);
  session.Advance(100 * sync::kMillisecond);
  EXPECT_EQ(session.started(), before + 1);
  EXPECT_THAT(std::string(last_.status.message()), HasSubstr("broken pipe"));
}

TEST_F(Reconnect, AServerThatDoesNotAnswerOpenIsGivenUp) {
  SessionUnderTest session(Make());
  session.Advance(15 * sync::kSecond - 1);
  EXPECT_FALSE(session.stream().cancelled);
  session.Advance(1);
  EXPECT_TRUE(session.stream().cancelled);
  session.End(absl::CancelledError(""));
  EXPECT_THAT(session->WaitOpened(kAtOnce).message(),
              HasSubstr("voxeld at there:1 did not answer Open in 15 s"));
  session.Advance(sync::kSecond);
  EXPECT_EQ(session.started(), 2u);
}

TEST_F(Reconnect, ResumesAndSendsAgainWhatWasNotApplied) {
  SessionUnderTest session(Make());
  session.SayOpened();
  for (const char* id : {"a", "b", "c"}) session.Put(id);
  session.SayAccepted(1, {"sim"});
  const uint64_t second_commit = session.stream().written[4].sequence();
  ASSERT_TRUE(session.stream().written[4].has_commit());
  session.End(kGone);
  EXPECT_EQ(session->FindReceipt(2)->state, Receipt::State::kQueued);
  session.Put("d");  // in the meantime
  session.Advance(sync::kSecond);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open resume token"));
  session.SayOpened(OpenedAgain(second_commit));
  EXPECT_THAT(session.TakeWords(), ElementsAre("l/c", "commit 3", "l/d", "commit 4"));
  EXPECT_THAT(changes_, ElementsAre(Kind::kOpened, Kind::kLost, Kind::kResumed));
  EXPECT_EQ(session->FindReceipt(2)->state, Receipt::State::kAccepted);
  EXPECT_EQ(session->FindReceipt(3)->sendings, 2u);
  // The outcome that is outstanding from the first connection.
  EXPECT_FALSE(session->FindReceipt(1)->settled);
  v1::StreamResponse response;
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(1);
  receipt->mutable_outcome()->set_display("sim");
  receipt->mutable_outcome()->mutable_presented();
  session.Say(response);
  EXPECT_TRUE(session->FindReceipt(1)->settled);
  // A token can be used once: the next resume uses the new one.
  session.End(kGone);
  session.Advance(sync::kSecond);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open resume token2"));
}

TEST_F(Reconnect, OutcomesThatDoNotComeAfterAResumeAreLost) {
  SessionUnderTest session(Make());
  session.SayOpened();
  session.Put("a");
  session.SayAccepted(1, {"sim"});
  session.End(kGone);
  session.Advance(sync::kSecond);
  session.SayOpened(OpenedAgain());
  session.Advance(11 * sync::kSecond);
  EXPECT_FALSE(session->FindReceipt(1)->settled);
  session.Advance(sync::kSecond);
  ASSERT_TRUE(session->FindReceipt(1)->settled);
  EXPECT_EQ(session->FindReceipt(1)->outcomes[0].kind, Outcome::Kind::kLost);
}

TEST_F(Reconnect, WhatCannotBeResumedIsSentAgain) {
  SessionUnderTest session(Make());
  session.SayOpened();
  session.Put("a");
  ASSERT_TRUE(session->Stage(TransformOperation{"l", "a", Affine::Translate({7, 0, 0})}).ok());
  ASSERT_TRUE(session->Stage(LayerOperation{"m", {.opacity = uint8_t{50}}}).ok());
  ASSERT_TRUE(session->Commit(nullptr, {}).ok());
  session.Settle();
  ASSERT_TRUE(session.DrawFrame("f").ok());
  session.SayAccepted(1, {"sim"});
  session.SayAccepted(2);
  session.SayAccepted(3);
  session.Put("b");  // not accepted
  session.End(kGone);
  session.Put("c");
  session.Advance(sync::kSecond);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open resume token"));
  session.End(absl::NotFoundError("no such session"));
  // Immediately, and without the token.
  EXPECT_EQ(session.started(), 3u);
  EXPECT_THAT(session.TakeWords(), ElementsAre("open"));
  session.SayOpened(OpenedAgain());
  EXPECT_THAT(session.TakeWords(), ElementsAre("layer l", "l/a", "layer m", "layer f", "f/x",
                                               "commit 6", "l/b", "commit 4", "l/c", "commit 5"));
  EXPECT_EQ(session.stream().written[2].batch().upserts(0).entity().transform().m(3), 7)
      << "where it was last";
  EXPECT_THAT(changes_, ElementsAre(Kind::kOpened, Kind::kLost, Kind::kRestored));
  EXPECT_EQ(last_.lost_outcomes, 1u);
  EXPECT_EQ(session->FindReceipt(1)->outcomes[0].kind, Outcome::Kind::kLost);
  EXPECT_EQ(session->GetTally().restored, 1u);
  // All of it is sent again.
  session.SayAccepted(6);
  session.SayAccepted(4);
  session.SayAccepted(5);
  session.End(kGone);
  session.Advance(sync::kSecond);
  session.End(absl::NotFoundError("no such session"));
  session.TakeWords();
  session.SayOpened();
  EXPECT_THAT(session.TakeWords(),
              ElementsAre("layer l", "l/a l/b l/c", "layer m", "layer f", "f/x", "commit 7"));
}

TEST_F(Reconnect, ASessionThatIsResumedMayHaveLostItsLayers) {
  for (const auto& [policy, away_s, kept] :
       {std::tuple(OnDisconnect::kLinger, 4, true), std::tuple(OnDisconnect::kLinger, 5, false),
        std::tuple(OnDisconnect::kClear, 1, false), std::tuple(OnDisconnect::kKeep, 9, true)}) {
    Options options = Make();
    options.on_disconnect = policy;
    SessionUnderTest session(options);
    session.SayOpened();
    for (const char* id : {"a", "b", "c"}) session.Put(id);
    session.SayAccepted(1, {"sim"});
    const uint64_t second_commit = session.stream().written[4].sequence();
    session.End(kGone);
    session.Advance(away_s * sync::kSecond);
    session.TakeWords();
    session.SayOpened(OpenedAgain(second_commit));
    // Commits that were applied but not reported were removed with the layers.
    if (kept) {
      EXPECT_THAT(session.TakeWords(), ElementsAre("l/c", "commit 3"));
      EXPECT_EQ(changes_.back(), Kind::kResumed);
    } else {
      EXPECT_THAT(session.TakeWords(),
                  ElementsAre("layer l", "l/a", "commit 4", "l/b", "commit 2", "l/c", "commit 3"));
      EXPECT_EQ(changes_.back(), Kind::kRestored);
      EXPECT_EQ(last_.lost_outcomes, 0u);
    }
    EXPECT_EQ(session->GetTally().resumed, 1u);
    EXPECT_FALSE(session->FindReceipt(1)->settled) << "its outcome may still arrive";
  }
}

TEST_F(Reconnect, TheOwnerIsJoinedAgainIfItIsStillThere) {
  SessionUnderTest session(Make());
  v1::Opened opened;
  opened.set_resume_token("r");
  opened.set_owner_token("o");
  session.SayOpened(opened);
  session.End(kGone);
  session.Advance(sync::kSecond);
  session.End(absl::NotFoundError(""));
  EXPECT_THAT(session.TakeWords(), ElementsAre("open owner o"));
  session.End(absl::NotFoundError(""));
  EXPECT_THAT(session.TakeWords(), ElementsAre("open"));
}

TEST_F(Reconnect, WhatTheServerWillNotTakeAgainIsAnIssue) {
  std::vector<Issue> issues;
  Options options = Make();
  options.on_issue = [&](const Issue& issue) { issues.push_back(issue); };
  SessionUnderTest session(options);
  session.SayOpened();
  session.Put("a");
  session.SayAccepted(1);
  session.End(kGone);
  session.Advance(sync::kSecond);
  session.End(absl::NotFoundError(""));
  session.SayOpened(OpenedAgain());
  v1::StreamResponse response;
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(2);
  receipt->mutable_refused()->set_message("no room");
  session.Say(response);
  ASSERT_EQ(issues.size(), 1u);
  EXPECT_EQ(issues[0].message,
            "what was up before the connection was lost is not put up again: no room");
}

TEST_F(Reconnect, RestoringKeepsToTheLimits) {
  SessionUnderTest session(Make());
  session.SayOpened();
  for (uint64_t i = 1; i <= 5; ++i) {
    session.Put(std::to_string(i));
    session.SayAccepted(i);
  }
  session.End(kGone);
  session.Advance(sync::kSecond);
  session.End(absl::NotFoundError(""));
  v1::Opened opened;
  opened.mutable_limits()->set_max_operations_per_commit(4);
  session.TakeWords();
  session.SayOpened(opened);
  EXPECT_THAT(session.TakeWords(),
              ElementsAre("layer l", "l/1 l/2 l/3", "commit 6", "l/4 l/5", "commit 7"));
}

TEST_F(Reconnect, FramesThatWaitAreKeptToTheNewestAndCounted) {
  Options options = Make();
  options.flow = Flow::kLatest;
  SessionUnderTest session(options);
  session.SayOpened();
  session.End(kGone);
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(session.DrawFrame("f").ok());
  session.Advance(sync::kSecond);
  session.SayOpened(OpenedAgain());
  EXPECT_THAT(session.TakeWords(),
              ElementsAre("open resume token", "begin f", "f/x", "end f", "commit 100"));
  EXPECT_EQ(session.stream().written.back().commit().client_drops(), 99u);
}

TEST_F(Reconnect, SomeEndsAreForGood) {
  for (const absl::Status& end :
       {absl::PermissionDeniedError("evicted"), absl::InvalidArgumentError("no"),
        absl::UnimplementedError("old"), absl::NotFoundError("owner")}) {
    changes_.clear();
    SessionUnderTest session(Make());
    session.Put("a");
    session.End(end);
    session.Advance(60 * sync::kSecond);
    EXPECT_EQ(session.started(), 1u);
    EXPECT_THAT(changes_, ElementsAre(Kind::kEnded));
    EXPECT_EQ(session->WaitOpened(kAtOnce), end);
    EXPECT_EQ(session->Commit(nullptr, {}).status(), end);
    EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kLost);
    EXPECT_TRUE(session->WaitSettled(kAtOnce).ok());
  }
}

TEST_F(Reconnect, WithoutItTheFirstEndIsTheLast) {
  Options options = Make();
  options.reconnect = false;
  SessionUnderTest session(options);
  session.SayOpened();
  session.End(absl::OkStatus());
  session.Advance(60 * sync::kSecond);
  EXPECT_EQ(session.started(), 1u);
  EXPECT_EQ(session->WaitForRoom(kAtOnce).message(), "voxeld at there:1 ended the stream");
}

TEST_F(Reconnect, ADeadConnectionIsNoticedByItsPings) {
  Options options = Make();
  options.ping_interval = std::chrono::seconds(1);
  SessionUnderTest session(options);
  session.SayOpened();
  v1::StreamResponse pong;
  pong.mutable_pong()->set_client_time_ns(session.clock().Now());
  session.Say(pong);
  for (int i = 0; i < 3; ++i) session.Advance(sync::kSecond);
  EXPECT_FALSE(session.stream().cancelled);
  for (int i = 0; i < 3; ++i) session.Advance(sync::kSecond);
  EXPECT_TRUE(session.stream().cancelled);
  session.End(absl::CancelledError(""));
  EXPECT_THAT(std::string(last_.status.message()), HasSubstr("did not answer 4 pings"));
  session.Advance(sync::kSecond);
  EXPECT_EQ(session.started(), 2u);
}

}  // namespace session_reconnect_test
}  // namespace voxeld::client
