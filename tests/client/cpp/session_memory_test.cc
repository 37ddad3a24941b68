// Tests a session whose server accepts content in sealed memory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cpp/src/encode.h"
#include "tests/client/cpp/fake_transport.h"

namespace voxeld::client {
namespace session_memory_test {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Answer = MemoryChannel::Answer;

const std::vector<float> kCloud(30'000, 1.5f);
constexpr size_t kCloudBytes = 120'000;

Options Quiet() {
  Options options;
  options.ping_interval = Duration(0);
  return options;
}

v1::Opened WithSocket(uint64_t credit_bytes = 0) {
  v1::Opened opened;
  opened.set_resume_token("token");
  opened.set_local_socket("/run/it");
  opened.set_local_token("secret");
  opened.set_credit_bytes(credit_bytes);
  return opened;
}

uint64_t PutCloud(SessionUnderTest& session, const std::string& id,
                  const CommitOptions& options = {}) {
  EXPECT_TRUE(session->StageUpsert("l", id, Points{.vertices = {.positions = kCloud}}, {}).ok());
  const absl::StatusOr<uint64_t> frame = session->Commit(nullptr, options);
  session.Settle();
  return frame.value_or(0);
}

const v1::Vertices& LastVertices(SessionUnderTest& session) {
  for (auto it = session.stream().written.rbegin(); it != session.stream().written.rend(); ++it) {
    if (it->has_batch()) return it->batch().upserts(0).entity().primitive().points().vertices();
  }
  return v1::Vertices::default_instance();
}

TEST(SessionMemory, ContentGoesByMemoryOnceItIsHeld) {
  SessionUnderTest session(Quiet());
  session.SayOpened(WithSocket());
  EXPECT_EQ(session.memory_path(), "/run/it secret");
  const uint64_t frame = PutCloud(session, "a");
  session.Put("small");
  EXPECT_THAT(session.TakeWords(), ElementsAre("open"))
      << "everything waits for the answer, in order";
  ASSERT_THAT(session.memory()->held, SizeIs(1));
  EXPECT_EQ(session.memory()->held[0].second,
            std::string(reinterpret_cast<const char*>(kCloud.data()), kCloudBytes));
  session.memory()->Answer(Answer::kHeld);
  session.Settle();
  EXPECT_THAT(session.TakeWords(), ElementsAre("l/a", "commit 1", "l/small", "commit 2"));
  const v1::Vertices& vertices =
      session.stream().written[1].batch().upserts(0).entity().primitive().points().vertices();
  EXPECT_EQ(vertices.positions_in().memory(), session.memory()->held[0].first);
  EXPECT_EQ(vertices.positions_in().size(), kCloudBytes);
  EXPECT_THAT(vertices.positions(), IsEmpty());
  EXPECT_EQ(session->GetTally().memory_bytes, kCloudBytes);
  EXPECT_EQ(session->GetTally().bytes_sent, session.stream().bytes);
  EXPECT_THAT(session.memory()->released, IsEmpty());
  session.SayAccepted(frame);
  EXPECT_THAT(session.memory()->released, ElementsAre(session.memory()->held[0].first));
  EXPECT_THAT(session->FindReceipt(1)->state, Receipt::State::kAccepted);
}

TEST(SessionMemory, EachIsReleasedByWhateverAnswersItsCommit) {
  SessionUnderTest session(Quiet());
  session.SayOpened(WithSocket());
  std::vector<uint64_t> ids;
  for (const char* id : {"a", "b", "c"}) {
    PutCloud(session, id, {.present_at_ns = id[0] == 'c' ? 1'000'000 : 0});
    session.memory()->Answer(Answer::kHeld);
    session.Settle();
    ids.push_back(session.memory()->held.back().first);
  }
  EXPECT_NE(ids[0], ids[1]);
  session.SayRefused(2, "no");
  EXPECT_THAT(session.memory()->released, ElementsAre(ids[1]));
  v1::StreamResponse response;
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(3);
  receipt->mutable_scheduled();
  session.Say(response);
  EXPECT_THAT(session.memory()->released, ElementsAre(ids[1], ids[2]));
  session.SayAccepted(3);
  session.SayAccepted(1);
  EXPECT_THAT(session.memory()->released, ElementsAre(ids[1], ids[2], ids[0]));
}

TEST(SessionMemory, WhatIsNotHeldIsSent) {
  for (const Answer answer : {Answer::kNoRoom, Answer::kRefused, Answer::kGone}) {
    SessionUnderTest session(Quiet());
    session.SayOpened(WithSocket());
    for (int i = 0; i < 10; ++i) {
      const size_t offered = session.memory()->held.size();
      const uint64_t frame = PutCloud(session, "a");
      if (session.memory()->held.size() > offered) {
        session.memory()->Answer(answer);
        session.Settle();
      }
      EXPECT_EQ(LastVertices(session).positions().size(), kCloudBytes);
      EXPECT_FALSE(LastVertices(session).has_positions_in());
      session.SayAccepted(frame);
    }
    EXPECT_THAT(session.memory()->held, SizeIs(answer == Answer::kNoRoom    ? 10
                                               : answer == Answer::kRefused ? 3
                                                                            : 1));
    EXPECT_THAT(session.memory()->released, IsEmpty());
    EXPECT_EQ(session->GetTally().memory_bytes, 0u);
    EXPECT_EQ(session->GetTally().bytes_sent, session.stream().bytes);
    EXPECT_EQ(session->GetTally().accepted, 10u);
    EXPECT_EQ(session->GetTally().issue_count, 0u);
  }
}

TEST(SessionMemory, CreditIsForWhatIsWritten) {
  SessionUnderTest session(Quiet());
  // Enough for what is written, but not for the content that it refers to.
  session.SayOpened(WithSocket(session.stream().bytes + 10'000));
  for (int i = 0; i < 20; ++i) {
    PutCloud(session, "a");
    ASSERT_FALSE(session.memory()->held.empty());
    session.memory()->Answer(Answer::kHeld);
    session.Settle();
  }
  EXPECT_TRUE(session.stream().written.back().has_commit());
  EXPECT_EQ(session.stream().written.back().commit().frame_id(), 20u);
  EXPECT_LT(session.stream().bytes, 10'000u);
}

TEST(SessionMemory, AfterALossItIsHandedOverAnew) {
  SessionUnderTest session(Quiet());
  session.SayOpened(WithSocket());
  PutCloud(session, "sent");
  session.memory()->Answer(Answer::kHeld);
  session.Settle();
  PutCloud(session, "being handed over");
  session.End(absl::UnavailableError("gone"));
  EXPECT_EQ(session.memory(), nullptr) << "it was closed with its stream";
  session.Advance(sync::kSecond);
  session.TakeWords();
  session.SayOpened(WithSocket());
  ASSERT_NE(session.memory(), nullptr);
  session.memory()->Answer(Answer::kHeld);
  session.Settle();
  session.memory()->Answer(Answer::kHeld);
  session.Settle();
  EXPECT_THAT(session.TakeWords(),
              ElementsAre("l/sent", "commit 1", "l/being handed over", "commit 2"));
  // A server without a socket gets it over the stream, and so does one to which the session is
  // restored.
  session.SayAccepted(1);
  session.End(absl::UnavailableError("gone"));
  session.Advance(sync::kSecond);
  session.End(absl::NotFoundError("no such session"));
  session.SayOpened();
  EXPECT_EQ(session.memory(), nullptr);
  EXPECT_EQ(LastVertices(session).positions().size(), kCloudBytes);
}

TEST(SessionMemory, PingsWaitForTheAnswerAndCloseDoesToo) {
  Options options;
  options.ping_interval = std::chrono::seconds(1);
  SessionUnderTest session(options);
  session.SayOpened(WithSocket());
  session.TakeWords();
  PutCloud(session, "a");
  session.Advance(2 * sync::kSecond);
  EXPECT_FALSE(session->Close(Duration(0)).ok());
  EXPECT_THAT(session.TakeWords(), IsEmpty());
  EXPECT_FALSE(session.stream().half_closed);
  session.memory()->Answer(Answer::kHeld);
  session.Settle();
  EXPECT_THAT(session.TakeWords(), ElementsAre("l/a", "ping", "commit 1"));
  EXPECT_TRUE(session.stream().half_closed);
}

TEST(SessionMemory, ItCanBeTurnedOff) {
  Options options = Quiet();
  options.local_memory = false;
  SessionUnderTest session(options);
  session.SayOpened(WithSocket());
  EXPECT_EQ(session.memory(), nullptr);
  PutCloud(session, "a");
  EXPECT_EQ(LastVertices(session).positions().size(), kCloudBytes);
}

TEST(SessionMemory, WhatIsSmallGoesOverTheStream) {
  SessionUnderTest session(Quiet());
  session.SayOpened(WithSocket());
  session.Put("a");
  EXPECT_THAT(session.memory()->held, IsEmpty());
  EXPECT_THAT(session.TakeWords(), Contains("commit 1"));
}

}  // namespace session_memory_test
}  // namespace voxeld::client
