// Tests the bounds on what a session holds and sends: the size of messages, what is staged, and
// what waits for callbacks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"
#include "tests/client/cpp/fake_transport.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr Duration kAtOnce{0};
constexpr uint64_t kMessage = 10'000;

Options Quiet() {
  Options options;
  options.ping_interval = Duration(0);
  return options;
}

v1::Opened OpenedWithLimit(uint64_t max_message_bytes = kMessage) {
  v1::Opened opened;
  opened.set_resume_token("token");
  opened.add_displays("sim");
  opened.mutable_limits()->set_max_message_bytes(max_message_bytes);
  return opened;
}

// Returns points of about `bytes`.
Shape Cloud(size_t bytes) {
  return Points{.vertices = {.positions = std::vector<float>(bytes / 12 * 3)}};
}

UpsertOperation Upsert(const std::string& layer, const std::string& id, const Shape& shape) {
  return {.layer = layer, .id = id, .primitive = *EncodePrimitive(shape, {}), .label = {}};
}

std::string MessageOf(const absl::Status& status) { return std::string(status.message()); }

TEST(Bounds, WhatWasCommittedBeforeTheLimitWasKnownIsRefusedAndNotSent) {
  for (const bool restore : {true, false}) {
    Options options = Quiet();
    options.restore = restore;
    SessionUnderTest session(options);
    const absl::StatusOr<DefineOperation> define =
        EncodeDefinition("big", {{.shape = Cloud(2 * kMessage)}});
    ASSERT_TRUE(session->Stage(*define).ok());
    ASSERT_EQ(*session->Commit(nullptr, {}), 1u);
    session.Put("small");
    // If there are many small ones, only the message was too large.
    for (int i = 0; i < 1000; ++i)
      ASSERT_TRUE(session->StageUpsert("l", absl::StrCat(i), Sphere{}, {}).ok());
    ASSERT_EQ(*session->Commit(nullptr, {}), 3u);
    session.SayOpened(OpenedWithLimit());
    const Receipt refused = *session->FindReceipt(1);
    EXPECT_EQ(refused.state, Receipt::State::kRefused);
    EXPECT_TRUE(refused.settled);
    EXPECT_THAT(refused.message, HasSubstr("the object \"big\" takes a message of 2"));
    EXPECT_THAT(MessageOf(session->WaitAccepted(1, kAtOnce).status()),
                HasSubstr("max_message_bytes is 10000; put it up in pieces"));
    size_t upserts = 0;
    for (const v1::StreamRequest& request : session.stream().written) {
      EXPECT_LE(request.ByteSizeLong(), kMessage);
      upserts += static_cast<size_t>(request.batch().upserts_size());
    }
    EXPECT_EQ(upserts, 1001u);
    EXPECT_EQ(session->FindReceipt(2)->state, Receipt::State::kSent);
    EXPECT_EQ(session->FindReceipt(3)->state, Receipt::State::kSent);
    EXPECT_EQ(session->GetTally().refused, 1u);
  }
}

TEST(Bounds, AMessageOfExactlyTheLimitIsSentAndOneByteMoreIsNot) {
  SessionUnderTest session(Quiet());
  // Its size is determined by its label.
  const auto put = [&](size_t label) {
    EXPECT_TRUE(session->StageUpsert("l", "a", Sphere{}, {.label = std::string(label, 'x')}).ok());
    return session->Commit(nullptr, {});
  };
  ASSERT_TRUE(put(1000).ok());
  session.SayOpened();
  const size_t rest = session.stream().written[1].ByteSizeLong() - 1000;
  session.End(absl::UnavailableError("gone"));
  session.Advance(sync::kSecond);
  // A sequence takes up to 11 bytes; the ones here take two.
  session.SayOpened(OpenedWithLimit(1000 + rest + 9));
  EXPECT_EQ(session->FindReceipt(1)->state, Receipt::State::kSent);
  EXPECT_TRUE(absl::IsInvalidArgument(put(1001).status()));
  EXPECT_TRUE(put(1000).ok());
}

TEST(Bounds, ACommitLeavesOutNothingButWhatIsTooLarge) {
  SessionUnderTest session(Quiet());
  // Staged before the limit was known.
  ASSERT_TRUE(session->StageUpsert("l", "before", Sphere{}, {}).ok());
  ASSERT_TRUE(session->StageUpsert("l", "big", Cloud(2 * kMessage), {}).ok());
  ASSERT_TRUE(session->StageUpsert("l", "after", Sphere{}, {}).ok());
  session.SayOpened(OpenedWithLimit());
  const absl::Status status = session->Commit(nullptr, {}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(MessageOf(status), HasSubstr("l/big takes a message of"));
  EXPECT_LT(session->staged_bytes(), kMessage);
  EXPECT_EQ(*session->Commit(nullptr, {}), 1u);
  session.Settle();
  EXPECT_THAT(session.TakeWords(), ElementsAre("open", "l/before l/after", "commit 1"));
}

TEST(Bounds, AFrameWithSomethingTooLargeIsRefusedWhole) {
  SessionUnderTest session(Quiet());
  session.SayOpened(OpenedWithLimit());
  session.TakeWords();
  ASSERT_TRUE(session->StageUpsert("l", "a", Sphere{}, {}).ok());
  FrameOperation frame{"f", {Upsert("f", "x", Sphere{}), Upsert("f", "big", Cloud(2 * kMessage))}};
  const absl::Status status = session->Commit(&frame, {}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(MessageOf(status), HasSubstr("f/big takes a message of"));
  EXPECT_THAT(frame.upserts, IsEmpty()) << "it is dropped";
  EXPECT_TRUE(absl::IsInvalidArgument(
      session->Stage(FrameOperation{"f", {Upsert("f", "big", Cloud(2 * kMessage))}})));
  ASSERT_TRUE(session->Commit(nullptr, {}).ok());
  session.Settle();
  EXPECT_THAT(session.TakeWords(), ElementsAre("l/a", "commit 1"));
  // An operation that is too large may be staged; the frame remains the caller's.
  SessionUnderTest other(Quiet());
  ASSERT_TRUE(other->StageUpsert("l", "big", Cloud(2 * kMessage), {}).ok());
  other.SayOpened(OpenedWithLimit());
  frame = {"f", {Upsert("f", "x", Sphere{})}};
  EXPECT_TRUE(absl::IsInvalidArgument(other->Commit(&frame, {}).status()));
  EXPECT_EQ(frame.upserts.size(), 1u);
  EXPECT_TRUE(other->Commit(&frame, {}).ok());
}

TEST(Bounds, WhatIsRestoredKeepsToTheNewServersLimit) {
  std::vector<Issue> issues;
  Options options = Quiet();
  options.on_issue = [&](const Issue& issue) { issues.push_back(issue); };
  SessionUnderTest session(options);
  session.SayOpened();
  ASSERT_TRUE(session->StageUpsert("l", "big", Cloud(2 * kMessage), {}).ok());
  ASSERT_TRUE(session->StageUpsert("l", "small", Sphere{}, {}).ok());
  ASSERT_TRUE(session->Commit(nullptr, {}).ok());
  session.Settle();
  session.SayAccepted(1);
  session.End(absl::UnavailableError("gone"));
  session.Advance(sync::kSecond);
  session.SayOpened(OpenedWithLimit());
  EXPECT_THAT(session.TakeWords(),
              ElementsAre("open resume token", "layer l", "l/small", "commit 2"));
  ASSERT_EQ(issues.size(), 1u);
  EXPECT_THAT(issues[0].message, HasSubstr("not put up again: l/big takes a message of"));
}

TEST(Bounds, WhatIsStagedIsBounded) {
  Options options = Quiet();
  options.most_staged_bytes = 5000;
  SessionUnderTest session(options);
  absl::Status status;
  int taken = 0;
  for (; status.ok() && taken < 1000; ++taken)
    status = session->StageUpsert("l", absl::StrCat(taken), Sphere{}, {});
  EXPECT_TRUE(absl::IsResourceExhausted(status));
  EXPECT_THAT(MessageOf(status), HasSubstr("of 5000 (most_staged_bytes) are staged; commit first"));
  EXPECT_LE(session->staged_bytes(), 5000u);
  ASSERT_TRUE(session->Commit(nullptr, {}).ok());
  EXPECT_TRUE(session->StageUpsert("l", "large", Cloud(20'000), {}).ok()) << "alone it is accepted";
  EXPECT_FALSE(session->StageUpsert("l", "a", Sphere{}, {}).ok());
}

TEST(Bounds, ASlowReceiptCallbackHoldsUpCommitsAndLosesNone) {
  std::map<uint64_t, uint64_t> calls;
  Options options = Quiet();
  options.on_receipt = [&](const Receipt& receipt) { ++calls[receipt.frame]; };
  options.buffer_bytes = size_t{1} << 30;
  SessionUnderTest session(options);
  // Nothing steps the session: it is as if the callback did not return.
  absl::StatusOr<uint64_t> number = 0;
  uint64_t taken = 0;
  while (number.ok() && taken < 2 * SessionCore::kMostUntold) {
    number = session->Commit(nullptr, {});
    if (number.ok()) taken = *number;
  }
  EXPECT_TRUE(absl::IsResourceExhausted(number.status()));
  EXPECT_THAT(MessageOf(number.status()), HasSubstr("65536 receipts wait for on_receipt"));
  EXPECT_EQ(taken, SessionCore::kMostUntold);
  session->Step();
  EXPECT_EQ(calls.size(), taken);
  EXPECT_TRUE(session->Commit(nullptr, {}).ok());
}

TEST(Bounds, OfAReceiptThatChangedOftenTheLastStateIsTold) {
  std::vector<Receipt> told;
  Options options = Quiet();
  options.on_receipt = [&](const Receipt& receipt) { told.push_back(receipt); };
  SessionUnderTest session(options);
  session.SayOpened();
  session.Put("a");
  told.clear();
  v1::StreamResponse response;
  response.add_receipts()->set_frame_id(1);
  response.mutable_receipts(0)->mutable_accepted()->add_displays("sim");
  session.stream().events->OnRead(response);
  response.mutable_receipts(0)->mutable_outcome()->set_display("sim");
  session.stream().events->OnRead(response);
  session->Step();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_TRUE(told[0].settled);
}

TEST(Bounds, IssuesThatASlowCallbackCannotTakeAreCounted) {
  uint64_t told = 0;
  Options options = Quiet();
  options.on_issue = [&](const Issue&) { ++told; };
  SessionUnderTest session(options);
  session.SayOpened();
  v1::StreamResponse response;
  for (int i = 0; i < 1000; ++i) response.add_issues()->set_sequence(999);
  for (int i = 0; i < 70; ++i) session.stream().events->OnRead(response);
  session->Step();
  EXPECT_EQ(told, SessionCore::kMostUntold);
  EXPECT_EQ(session->GetTally().untold_issues, 70'000 - SessionCore::kMostUntold);
  EXPECT_EQ(session->GetTally().issue_count, 70'000u);
  session.Say(response);
  EXPECT_EQ(told, SessionCore::kMostUntold + 1000);
}

}  // namespace
}  // namespace voxeld::client
