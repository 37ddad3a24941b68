// Tests StreamSession on a port of the test's: what is read, what waits, what continues, step by
// step.
#include "daemon/services/stream_session.h"

#include <gmock/gmock.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/daemon/fakes/simulation.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::services {
namespace stream_session_test {

using testing::Simulation;

class Bytes final : public ReceivedMessage {
 public:
  explicit Bytes(const v1::StreamRequest& request)
      : bytes_(request.SerializeAsString()), view_(bytes_) {}
  std::span<const std::string_view> slices() const override { return {&view_, 1}; }

 private:
  const std::string bytes_;
  const std::string_view view_;
};

class Port final : public StreamPort {
 public:
  void Read() override { ++reads; }
  void Write(const std::string& message) override {
    writing = true;
    v1::StreamResponse response;
    EXPECT_TRUE(response.ParseFromString(message));
    issues += static_cast<size_t>(response.issues_size());
    for (const v1::Receipt& receipt : response.receipts()) {
      accepted += receipt.has_accepted();
      outcomes += receipt.has_outcome();
    }
  }
  void Finish(const absl::Status& status) override {
    EXPECT_FALSE(finished.has_value());
    finished = status;
  }
  void SetAlarm(sync::TimeNs) override {}
  void Post() override { ++posts; }

  int reads = 0, posts = 0;
  bool writing = false;
  size_t issues = 0, accepted = 0, outcomes = 0;
  std::optional<absl::Status> finished;
};

class StreamSessionTest : public ::testing::Test {
 protected:
  void Begin(Limits limits = {}, StreamLimits streams = {}) {
    sim_.emplace(limits, 0);
    sim_->Start();
    context_.reset(new ServiceContext{*sim_->core, sim_->clock, counters_, "1", nullptr, streams});
    session_ = std::make_shared<StreamSession>(*context_, &port_);
    session_->SetCaller({.scopes = access::Scopes::All()});
    session_->Start();
    v1::StreamRequest open;
    open.mutable_open();
    EXPECT_TRUE(Arrive(open));
    EXPECT_FALSE(AReadIsPending()) << "nothing is read before Opened";
    sim_->core->Step();
    WriteAll();
  }
  ~StreamSessionTest() override {
    if (session_ != nullptr) session_->OnPortDone();
    if (sim_.has_value()) sim_->core->Step();
  }

  bool AReadIsPending() const { return port_.reads > arrived_; }
  // Completes the pending read with a message; returns false if no read is pending.
  bool Arrive(const v1::StreamRequest& request) {
    if (!AReadIsPending()) return false;
    ++arrived_;
    session_->OnMessage(std::make_unique<Bytes>(request));
    return true;
  }
  void WriteAll() {
    while (std::exchange(port_.writing, false)) session_->OnWritten(true);
  }
  void TakeTurns() {
    for (; turns_ < port_.posts; ++turns_) session_->OnTurn();
  }
  uint64_t Arriving() { return sim_->core->budget()->used_bytes(Budget::Use::kArriving); }
  uint64_t Applied() { return sim_->GetStats().commits_accepted; }

  // Sends a commit that waits, and fills an intake of 500 bytes behind it.
  void Fill() {
    for (const v1::StreamRequest& request : CommitOf(10)) EXPECT_TRUE(Arrive(request));
    EXPECT_TRUE(Arrive(CommitOf(200)[0]));
    EXPECT_TRUE(Arrive(CommitOf(200)[0]));
    EXPECT_TRUE(Arrive(CommitOf(200)[0]));
  }
  // Returns an upsert that weighs at least `bytes` on the wire (256 at most), and a commit.
  static std::vector<v1::StreamRequest> CommitOf(size_t bytes) {
    std::vector<v1::StreamRequest> requests(2);
    v1::Upsert* upsert = requests[0].mutable_upsert();
    upsert->set_layer("l");
    upsert->set_id("e");
    upsert->mutable_entity()->mutable_primitive()->mutable_sphere()->set_radius(1);
    upsert->mutable_entity()->set_label(std::string(bytes, 'b'));
    requests[1].mutable_commit()->set_frame_id(1);
    return requests;
  }

  std::optional<Simulation> sim_;
  listen::Counters counters_;
  std::unique_ptr<ServiceContext> context_;
  Port port_;
  std::shared_ptr<StreamSession> session_;
  int arrived_ = 0, turns_ = 0;
};

TEST_F(StreamSessionTest, WhatArrivesWhileTheIntakeIsFullWaitsAndGoesOnInOrder) {
  Limits limits;
  limits.credit_bytes = 500;
  Begin(limits);
  // The core applies no commit yet. The first waits; those after it hold its credit.
  uint64_t commits = 0;
  while (AReadIsPending() && commits < 40) {
    const std::vector<v1::StreamRequest> commit = CommitOf(200);
    if (Arrive(commit[0]) && Arrive(commit[1])) ++commits;
  }
  EXPECT_EQ(commits, 4u);
  EXPECT_FALSE(AReadIsPending());
  EXPECT_GT(Arriving(), 0u) << "its read was pending when the one before filled it";
  EXPECT_EQ(port_.posts, 0);
  sim_->core->Step();
  EXPECT_TRUE(AReadIsPending());
  TakeTurns();
  EXPECT_EQ(Arriving(), 0u);
  sim_->core->Step();
  EXPECT_EQ(Applied(), commits);
}

TEST_F(StreamSessionTest, WhatWasReadAheadIsNotHandedToAFullIntake) {
  Limits limits;
  limits.credit_bytes = 500;
  Begin(limits);
  Fill();
  // As if these had been on their way when the intake filled.
  port_.reads += 2;
  EXPECT_TRUE(Arrive(CommitOf(0)[1]));
  for (const v1::StreamRequest& request : CommitOf(200)) EXPECT_TRUE(Arrive(request));
  EXPECT_GT(Arriving(), 200u);
  EXPECT_EQ(port_.posts, 0);

  sim_->core->Step();
  EXPECT_EQ(Applied(), 1u);
  EXPECT_EQ(port_.posts, 1) << "a thread of the port continues";
  EXPECT_GT(Arriving(), 200u) << "not the core's";
  TakeTurns();
  EXPECT_EQ(Arriving(), 0u);
  sim_->core->Step();
  EXPECT_EQ(Applied(), 3u);
  EXPECT_TRUE(AReadIsPending());
}

TEST_F(StreamSessionTest, WhatArrivesWaitsForAClientThatLeavesItsAnswersUnread) {
  StreamLimits streams;
  streams.max_queued_answers = 8;
  Begin({}, streams);
  v1::StreamRequest bad;
  bad.mutable_batch()->add_upserts();
  bad.mutable_batch()->add_upserts();
  port_.reads += 20;
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(Arrive(bad));
  EXPECT_FALSE(port_.finished.has_value()) << "it is paused, not ended";
  EXPECT_GT(Arriving(), 0u);
  for (int i = 0; i < 200 && Arriving() > 0; ++i) {
    if (std::exchange(port_.writing, false)) session_->OnWritten(true);
    TakeTurns();
  }
  WriteAll();
  EXPECT_FALSE(port_.finished.has_value());
  EXPECT_EQ(port_.issues, 40u);
}

TEST_F(StreamSessionTest, OutcomesKeptForASessionThatIsTakenUpAreNotLeftUnread) {
  StreamLimits streams;
  streams.max_queued_answers = 8;
  Begin({}, streams);
  const auto outcome = [](uint64_t incarnation) {
    return Receipt{1, 1, CommitOutcome{.display = "d"}, incarnation};
  };
  for (int i = 0; i < 40; ++i) session_->OnReceipt(outcome(7));
  EXPECT_FALSE(port_.finished.has_value());
  WriteAll();
  EXPECT_EQ(port_.outcomes, 40u);
  // Its own outcomes are sent, however many there were before.
  for (int i = 0; i < 60 && !port_.finished.has_value(); ++i) session_->OnReceipt(outcome(0));
  ASSERT_TRUE(port_.finished.has_value());
  EXPECT_EQ(port_.finished->code(), absl::StatusCode::kResourceExhausted);
}

TEST_F(StreamSessionTest, TheEndOfReadsComesAfterWhatWaits) {
  Limits limits;
  limits.credit_bytes = 500;
  Begin(limits);
  Fill();
  EXPECT_TRUE(Arrive(CommitOf(0)[1]));
  session_->OnReadsDone();
  for (int i = 0; i < 4; ++i) {
    sim_->core->Step();
    TakeTurns();
    WriteAll();
  }
  EXPECT_EQ(Applied(), 2u);
  EXPECT_EQ(port_.accepted, 2u);
  ASSERT_TRUE(port_.finished.has_value());
  EXPECT_TRUE(port_.finished->ok()) << *port_.finished;
}

TEST_F(StreamSessionTest, WhatWaitsWhenTheClientIsGoneIsDroppedAndGivenBack) {
  Limits limits;
  limits.credit_bytes = 500;
  Begin(limits);
  Fill();
  EXPECT_TRUE(Arrive(CommitOf(0)[1]));
  EXPECT_GT(Arriving(), 0u);
  session_->OnCancel();
  ASSERT_TRUE(port_.finished.has_value());
  session_->OnPortDone();
  EXPECT_EQ(Arriving(), 0u);
  session_->OnTurn();  // late ones have no effect
  session_->OnAlarm();
  sim_->core->Step();
  EXPECT_EQ(Applied(), 1u) << "the commit that was handed over";
  session_ = nullptr;
}

}  // namespace stream_session_test
}  // namespace voxeld::daemon::services
