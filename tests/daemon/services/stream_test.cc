// Tests SceneService.Stream with a real server.
#include <gmock/gmock.h>

#include <set>

#include "absl/strings/str_cat.h"
#include "daemon/services/stream_session.h"
#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(Stream, OpensAppliesAndTellsWhatBecameOfIt) {
  Daemon daemon({.displays = {"left", "right"}});
  Client client(daemon.scene());
  v1::Open open;
  open.set_client_name("test");
  const v1::Opened opened = client.Open(open);
  EXPECT_GT(opened.session(), 0u);
  EXPECT_GT(opened.owner(), 0u);
  EXPECT_EQ(opened.server_version(), "9.8.7");
  EXPECT_GT(opened.server_time_ns(), 0);
  EXPECT_GT(opened.credit_bytes(), Limits().credit_bytes) << "Open's own bytes included";
  EXPECT_EQ(opened.resume_token().size(), 16u);
  EXPECT_EQ(opened.owner_token().size(), 16u);
  EXPECT_THAT(opened.displays(), ElementsAre("left", "right"));
  EXPECT_EQ(opened.limits().max_id_bytes(), Limits().max_id_bytes);

  client.Send(SphereIn("layer", "ball"));
  client.Commit(17);
  client.ReadOutcomes(2);
  ASSERT_THAT(client.answers, SizeIs(1));
  EXPECT_EQ(client.answers[0].frame_id(), 17u);
  EXPECT_EQ(client.answers[0].sequence(), 3u);  // open, upsert, commit
  EXPECT_THAT(client.answers[0].accepted().displays(), ElementsAre("left", "right"));
  std::set<std::string> displays;
  for (const v1::Receipt& receipt : client.outcomes) {
    EXPECT_EQ(receipt.frame_id(), 17u);
    EXPECT_TRUE(receipt.outcome().has_presented()) << receipt.ShortDebugString();
    EXPECT_EQ(receipt.outcome().presented().evidence(), v1::EVIDENCE_DEVICE);
    displays.insert(receipt.outcome().display());
  }
  EXPECT_THAT(displays, ElementsAre("left", "right"));
  client.HalfClose();
  const grpc::Status status = client.Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(daemon.Entities().total(), 0u)
      << "CLEAR is the default, and applied when the call ends";
  EXPECT_EQ(daemon.Stats().sessions(), 0u);
}

TEST(Stream, OpenMustComeInTime) {
  Daemon daemon({.open_limit_ns = 50 * sync::kMillisecond});
  Client open(daemon.scene());
  open.Open();
  Client silent(daemon.scene());
  const grpc::Status status = silent.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_THAT(status.error_message(), HasSubstr("no open came within 50 ms"));
  open.Commit(1);  // later than that, and without effect on it
  open.ReadOutcomes(1);
}

TEST(Stream, OpenMustBeSmall) {
  Daemon daemon;
  Client client(daemon.scene());
  v1::StreamRequest request;
  request.mutable_open()->set_client_name(std::string(kOpenBytes, 'n'));
  client.Send(request);
  const grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("open has at most 49152: send it alone"));
}

TEST(Stream, FirstMessageMustBeOpen) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Send(SphereIn("layer", "ball"));
  const grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("first message of a stream must be open"));

  Client silent(daemon.scene());
  silent.HalfClose();
  EXPECT_EQ(silent.Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
}

TEST(Stream, ASecondOpenIsAnIssue) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  v1::StreamRequest again;
  again.mutable_open();
  client.Send(again);
  client.Send(SphereIn("layer", "ball"));
  client.Commit(1);
  client.ReadOutcomes(1);
  ASSERT_THAT(client.issues, SizeIs(1));
  EXPECT_EQ(client.issues[0].reason(), v1::REASON_OUT_OF_ORDER);
  EXPECT_EQ(client.issues[0].field(), "open");
  EXPECT_EQ(client.answers[0].accepted().refused_operations(), 1u);
}

TEST(Stream, ARefusedOpenEndsIt) {
  Daemon daemon;
  v1::StreamRequest request;
  request.mutable_open()->set_resume_token("0123456789abcdef");
  Client client(daemon.scene());
  client.Send(request);
  grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(status.error_message(), HasSubstr("open.resume_token names no session"));

  Daemon full({.limits = {.max_sessions = 1}});
  Client first(full.scene());
  first.Open();
  Client second(full.scene());
  request.mutable_open()->Clear();
  second.Send(request);
  status = second.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("max_sessions"));
}

TEST(Stream, BadOperationsAreIssuesAndTheRestIsApplied) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  v1::StreamRequest batch;
  for (int i = 0; i < 10'000; ++i) {
    *batch.mutable_batch()->add_upserts() = SphereIn("layer", absl::StrCat(i)).upsert();
  }
  batch.mutable_batch()
      ->mutable_upserts(4321)
      ->mutable_entity()
      ->mutable_primitive()
      ->mutable_sphere()
      ->set_radius(-1);
  client.Send(batch);
  v1::StreamRequest move;
  move.mutable_set_transform()->set_layer("layer");
  move.mutable_set_transform()->set_id("nobody");
  client.Send(move);
  client.Commit(1);
  client.ReadOutcomes(1);
  ASSERT_THAT(client.issues, SizeIs(2));
  EXPECT_EQ(client.issues[0].field(), "batch.upserts[4321].entity.primitive.sphere.radius");
  EXPECT_EQ(client.issues[0].id(), "4321");
  EXPECT_EQ(client.issues[0].sequence(), 2u);
  EXPECT_EQ(client.issues[1].reason(), v1::REASON_NOT_FOUND);
  EXPECT_EQ(client.answers[0].accepted().refused_operations(), 2u);
  EXPECT_EQ(daemon.Entities().total(), 9'999u);
}

TEST(Stream, ABatchOfNothingButBadOnesIsCutShortAndTheStreamGoesOn) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  constexpr int kBad = 50'000;  // more than the answers that may wait for a client
  v1::StreamRequest batch;
  for (int i = 0; i < kBad; ++i) batch.mutable_batch()->add_upserts();
  *batch.mutable_batch()->add_upserts() = SphereIn("layer", "good").upsert();
  client.Send(batch);
  client.Commit(1);
  client.ReadOutcomes(1);
  const size_t told = Limits().max_issues_per_commit;
  ASSERT_THAT(client.issues, SizeIs(told + 1));
  EXPECT_EQ(client.issues[told - 1].field(), absl::StrCat("batch.upserts[", told - 1, "].layer"));
  EXPECT_EQ(client.issues[told].field(), "commit");
  EXPECT_THAT(client.issues[told].message(), HasSubstr("49000 more issues are left out"));
  EXPECT_EQ(client.answers[0].accepted().refused_operations(), static_cast<uint64_t>(kBad));
  EXPECT_EQ(daemon.Entities().total(), 1u);
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
}

TEST(Stream, StrictRefusesTheWholeCommit) {
  Daemon daemon;
  Client client(daemon.scene());
  v1::Open open;
  open.set_strict(true);
  client.Open(open);
  client.Send(SphereIn("layer", "good"));
  client.Send(SphereIn("layer", "bad", -1));
  client.Commit(5);
  client.Send(SphereIn("layer", "good"));
  client.Commit(6);
  client.ReadOutcomes(1);
  ASSERT_THAT(client.answers, SizeIs(2));
  EXPECT_EQ(client.answers[0].refused().refused_operations(), 1u);
  EXPECT_THAT(client.answers[0].refused().message(), HasSubstr("radius"));
  EXPECT_TRUE(client.answers[1].has_accepted());
  EXPECT_EQ(client.outcomes[0].frame_id(), 6u);
}

TEST(Stream, OutOfOrderIsAnIssue) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  v1::StreamRequest end;
  end.mutable_frame_end()->set_layer("layer");
  client.Send(end);
  v1::StreamRequest late = SphereIn("layer", "late");
  late.set_sequence(1);
  client.Send(late);
  client.Commit(1);
  client.ReadOutcomes(1);
  ASSERT_THAT(client.issues, SizeIs(2));
  std::set<std::string> fields;
  for (const v1::Issue& issue : client.issues) {
    EXPECT_EQ(issue.reason(), v1::REASON_OUT_OF_ORDER) << issue.ShortDebugString();
    fields.insert(issue.field());
  }
  EXPECT_TRUE(fields.contains("sequence"));
  EXPECT_EQ(client.answers[0].accepted().refused_operations(), 2u);
}

TEST(Stream, ACommitThatCannotBeDurableIsCarriedOutAndSaysSo) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  v1::StreamRequest commit;
  commit.mutable_commit()->set_durable(true);
  client.Send(commit);
  client.ReadOutcomes(1);
  ASSERT_THAT(client.issues, SizeIs(1));
  EXPECT_EQ(client.issues[0].reason(), v1::REASON_UNIMPLEMENTED);
  EXPECT_EQ(client.issues[0].field(), "commit.durable");
  EXPECT_TRUE(client.issues[0].applied());
  EXPECT_EQ(client.answers[0].accepted().refused_operations(), 0u);
  EXPECT_FALSE(client.answers[0].accepted().durable());
}

TEST(Stream, PingsAreAnsweredOutOfTurn) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  v1::StreamRequest request;
  request.mutable_ping()->set_client_time_ns(1234);
  client.Send(request);
  const std::optional<v1::StreamResponse> response = client.Read();
  ASSERT_TRUE(response.has_value() && response->has_pong());
  EXPECT_EQ(response->pong().client_time_ns(), 1234);
  EXPECT_GT(response->pong().received_time_ns(), 0);
  EXPECT_GE(response->pong().server_time_ns(), response->pong().received_time_ns());
}

TEST(Stream, CreditComesForWhatIsApplied) {
  Limits limits;
  limits.credit_bytes = 4096;
  Daemon daemon({.limits = limits, .displays = {}});
  Client client(daemon.scene());
  uint64_t credit = client.Open().credit_bytes();
  const uint64_t first = credit;
  uint64_t sent = 0;
  // Never more than the credit at once, and yet it continues.
  for (uint64_t frame = 1; sent < 10 * limits.credit_bytes; ++frame) {
    const v1::StreamRequest upsert = SphereIn("layer", "ball");
    v1::StreamRequest commit;
    commit.mutable_commit()->set_frame_id(frame);
    const uint64_t bytes = upsert.ByteSizeLong() + commit.ByteSizeLong();
    while (sent + bytes > credit - 64) {
      const std::optional<v1::StreamResponse> response = client.Read();
      ASSERT_TRUE(response.has_value());
      credit = std::max(credit, response->credit_bytes());
    }
    ASSERT_TRUE(client.Send(upsert) && client.Send(commit));
    sent += bytes;
  }
  EXPECT_GT(credit, first);
  EXPECT_LE(credit, first + sent);
}

TEST(Stream, IsTakenUpByItsToken) {
  Daemon daemon;
  Client client(daemon.scene());
  v1::Open open;
  open.set_on_disconnect(v1::DISCONNECT_POLICY_KEEP);
  const v1::Opened opened = client.Open(open);
  client.Send(SphereIn("layer", "ball"));
  client.Commit(5);
  client.ReadOutcomes(1);
  open.set_resume_token(opened.resume_token());
  Client again(daemon.scene());
  const v1::Opened resumed = again.Open(open);
  EXPECT_EQ(resumed.session(), opened.session());
  EXPECT_EQ(resumed.last_frame_id(), 5u);
  EXPECT_EQ(resumed.last_sequence(), 3u);
  EXPECT_EQ(client.Finish().error_code(), grpc::StatusCode::ABORTED);
  EXPECT_EQ(daemon.Entities().total(), 1u);
  EXPECT_FALSE(daemon.Entities().layers(0).orphaned());
}

TEST(Stream, BytesThatAreNoRequestEndIt) {
  Daemon daemon;
  v1::StreamRequest request = SphereIn("layer", "ball");
  request.mutable_upsert()->set_id("\xFF not UTF-8");
  Client client(daemon.scene());
  client.Open();
  client.Send(request);
  const grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("UTF-8"));
  EXPECT_TRUE(daemon.Await([](const v1::Stats& stats) { return stats.sessions() == 0; }));
}

TEST(Stream, TooGreatAMessageEndsIt) {
  Daemon daemon({.limits = {.max_message_bytes = 5000}});
  Client client(daemon.scene());
  client.Open();
  v1::StreamRequest request = SphereIn("layer", "ball");
  request.mutable_upsert()->mutable_entity()->set_label(std::string(6000, 'x'));
  client.Send(request);
  EXPECT_EQ(client.Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(daemon.Await([](const v1::Stats& stats) { return stats.sessions() == 0; }));
}

TEST(Stream, HalfCloseDeliversWhatIsOwed) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  constexpr int kCommits = 50;
  for (int i = 0; i < kCommits; ++i) {
    client.Send(SphereIn("layer", "ball", 0.1 + 0.01 * i));
    client.Commit(100 + i);
  }
  client.HalfClose();
  const grpc::Status status = client.Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_THAT(client.answers, SizeIs(kCommits));
  EXPECT_THAT(client.outcomes, SizeIs(kCommits));
  std::set<uint64_t> frames;
  for (const v1::Receipt& receipt : client.outcomes) frames.insert(receipt.frame_id());
  EXPECT_THAT(frames, SizeIs(kCommits));
  EXPECT_EQ(daemon.Stats().outcomes_undelivered(), 0u);
}

TEST(Stream, HalfCloseWaitsNoLongerThanItsLimit) {
  Daemon daemon({.drain_limit_ns = 500 * sync::kMillisecond, .stuck = true});
  Client client(daemon.scene());
  client.Open();
  client.Send(SphereIn("layer", "ball"));
  client.Commit(1);
  client.HalfClose();
  const grpc::Status status = client.Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_THAT(client.answers, SizeIs(1));
  EXPECT_THAT(client.outcomes, SizeIs(0));
  const v1::Stats stats = daemon.Stats();
  EXPECT_EQ(stats.sessions(), 0u);
  EXPECT_EQ(stats.displays(0).commits_pending(), 1u);
}

TEST(Stream, WithoutOutcomesACommitIsAnsweredAlone) {
  Daemon daemon;
  Client client(daemon.scene());
  v1::Open open;
  open.set_no_outcomes(true);
  client.Open(open);
  client.Send(SphereIn("layer", "ball"));
  client.Commit(1);
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
  EXPECT_THAT(client.answers, SizeIs(1));
  EXPECT_THAT(client.outcomes, SizeIs(0));
}

TEST(Stream, AClientThatVanishesInMidFrameLeavesTheOthersAlone) {
  Daemon daemon;
  Client other(daemon.scene());
  other.Open();
  other.Send(SphereIn("theirs", "ball"));
  other.Commit(1);
  other.ReadOutcomes(1);
  {
    Client client(daemon.scene());
    v1::Open open;
    open.set_on_disconnect(v1::DISCONNECT_POLICY_KEEP);
    client.Open(open);
    client.Send(SphereIn("mine", "kept"));
    client.Commit(1);
    client.ReadOutcomes(1);
    v1::StreamRequest begin;
    begin.mutable_frame_begin()->set_layer("mine");
    client.Send(begin);
    client.Send(SphereIn("mine", "never"));
    client.Cancel();
    EXPECT_EQ(client.Finish().error_code(), grpc::StatusCode::CANCELLED);
  }
  EXPECT_TRUE(daemon.Await([](const v1::Stats& stats) { return stats.sessions() == 1; }));
  std::set<std::string> ids;
  const v1::ListEntitiesResponse entities = daemon.Entities();
  for (const auto& entity : entities.entities()) {
    ids.insert(absl::StrCat(entity.key().layer(), "/", entity.key().id()));
  }
  EXPECT_THAT(ids, ElementsAre("mine/kept", "theirs/ball"));
  other.Send(SphereIn("theirs", "second"));
  other.Commit(2);
  other.ReadOutcomes(2);
}

TEST(Stream, MessagesKeepTheirOrder) {
  Daemon daemon;
  Client client(daemon.scene());
  v1::Open open;
  open.set_no_outcomes(true);
  client.Open(open);
  // If one overtook another, it would leave a frame open, or be outside it.
  constexpr int kFrames = 500;
  for (int i = 1; i <= kFrames; ++i) {
    v1::StreamRequest request;
    request.mutable_frame_begin()->set_layer("layer");
    client.Send(request);
    client.Send(SphereIn("layer", absl::StrCat(i)));
    request.mutable_frame_end()->set_layer("layer");
    client.Send(request);
    client.Commit(i);
  }
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
  EXPECT_THAT(client.issues, SizeIs(0));
  ASSERT_THAT(client.answers, SizeIs(kFrames));
  for (int i = 0; i < kFrames; ++i) EXPECT_EQ(client.answers[i].frame_id(), i + 1u);
}

TEST(Stream, SeveralClientsAtOnceAndSumsAreExact) {
  Daemon daemon;
  constexpr int kClients = 4, kCommits = 25;
  std::vector<std::unique_ptr<Client>> clients;
  for (int c = 0; c < kClients; ++c) {
    clients.push_back(std::make_unique<Client>(daemon.scene()));
    clients.back()->Open();
  }
  for (int i = 0; i < kCommits; ++i) {
    for (auto& client : clients) {
      client->Send(SphereIn("layer", "ball", 0.1 + 0.02 * i));
      client->Commit(i);
    }
  }
  for (auto& client : clients) client->ReadOutcomes(kCommits);
  const v1::Stats stats = daemon.Stats();
  EXPECT_EQ(stats.sessions(), static_cast<uint64_t>(kClients));
  EXPECT_EQ(stats.entities(), static_cast<uint64_t>(kClients));
  EXPECT_EQ(stats.commits_accepted(), static_cast<uint64_t>(kClients * kCommits));
  const v1::DisplayStats& sim = stats.displays(0);
  EXPECT_EQ(sim.commits_owed(), stats.commits_accepted());
  EXPECT_EQ(sim.commits_owed(), sim.commits_presented() + sim.commits_unchanged() +
                                    sim.commits_superseded() + sim.commits_lost() +
                                    sim.commits_not_shown() + sim.commits_pending());
  EXPECT_EQ(sim.commits_pending(), 0u);
}

TEST(Stream, AClientThatDoesNotReadIsEnded) {
  Daemon daemon({.max_queued_answers = 100});
  Client client(daemon.scene());
  client.Open();
  // Each commit is answered, but no answer is read, until flow control stops the answers and the
  // queue fills.
  int sent = 0;
  while (client.Commit(1) && sent < 1'000'000) ++sent;
  EXPECT_LT(sent, 1'000'000);
  const grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("unread"));
  EXPECT_TRUE(daemon.Await([](const v1::Stats& stats) {
    return stats.sessions() == 0 && stats.streams_overrun() == 1;
  }));
}

TEST(Stream, EndsWithUnavailableAtShutdown) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open();
  client.Send(SphereIn("layer", "ball"));
  client.Commit(1);
  client.ReadOutcomes(1);
  daemon.server().Shutdown(10 * sync::kSecond);
  const grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(status.error_message(), "shutting down");
}

}  // namespace
}  // namespace voxeld::daemon::services
