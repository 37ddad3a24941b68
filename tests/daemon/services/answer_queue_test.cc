#include "daemon/services/answer_queue.h"

#include <gtest/gtest.h>

#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::services {
namespace {

Receipt Outcome(uint64_t frame_id) {
  CommitOutcome outcome;
  outcome.display = "d";
  return {frame_id, frame_id, outcome};
}

class AnswerQueueTest : public ::testing::Test {
 protected:
  v1::StreamResponse Pop(sync::TimeNs now = 7) {
    v1::StreamResponse message;
    EXPECT_TRUE(message.ParseFromString(queue.Pop(now)));
    return message;
  }

  std::shared_ptr<Budget> budget = std::make_shared<Budget>(100'000);
  AnswerQueue queue{budget};
};

TEST_F(AnswerQueueTest, WhatWaitsTogetherGoesTogether) {
  EXPECT_TRUE(queue.empty());
  ASSERT_TRUE(queue.Add(Issue{1, "a", "b", "f", Reason::kInvalidValue, "m"}));
  ASSERT_TRUE(queue.Add(Receipt{2, 3, Accepted{4, 0, 5, {"d"}}}));
  ASSERT_TRUE(queue.Add(Outcome(2)));
  queue.SetCredit(100);
  queue.SetCredit(200);
  queue.AddPong(11, 12);
  EXPECT_EQ(queue.size(), 3u);
  EXPECT_GT(budget->used_bytes(Budget::Use::kAnswers), 0u);
  const v1::StreamResponse message = Pop(13);
  EXPECT_EQ(message.issues_size(), 1);
  ASSERT_EQ(message.receipts_size(), 2);
  EXPECT_TRUE(message.receipts(0).has_accepted());
  EXPECT_TRUE(message.receipts(1).has_outcome());
  EXPECT_EQ(message.credit_bytes(), 200u);
  EXPECT_EQ(message.pong().client_time_ns(), 11);
  EXPECT_EQ(message.pong().received_time_ns(), 12);
  EXPECT_EQ(message.pong().server_time_ns(), 13);
  EXPECT_EQ(message.server_time_ns(), 13);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(budget->used_bytes(), 0u);
}

TEST_F(AnswerQueueTest, OpenedGoesFirstAndAlone) {
  v1::StreamResponse opened;
  opened.mutable_opened()->set_session(5);
  ASSERT_TRUE(queue.Add(Outcome(1)));
  queue.AddOpened(opened.SerializeAsString());
  EXPECT_EQ(Pop().opened().session(), 5u);
  EXPECT_EQ(Pop().receipts_size(), 1);
}

TEST_F(AnswerQueueTest, AMessageIsNotMuchMoreThanItsSize) {
  budget = std::make_shared<Budget>(100 << 20);
  AnswerQueue large(budget);
  for (uint64_t i = 1; i <= 5000; ++i) ASSERT_TRUE(large.Add(Outcome(i)));
  uint64_t next = 1;
  int messages = 0;
  while (!large.empty()) {
    const std::string bytes = large.Pop(1);
    EXPECT_LT(bytes.size(), 70'000u);
    v1::StreamResponse message;
    ASSERT_TRUE(message.ParseFromString(bytes));
    for (const v1::Receipt& receipt : message.receipts()) EXPECT_EQ(receipt.frame_id(), next++);
    ++messages;
  }
  EXPECT_EQ(next, 5001u);
  EXPECT_GT(messages, 5);
}

TEST_F(AnswerQueueTest, ABudgetUsedUpByOthersRefusesOnlyWhoeverDoesNotRead) {
  budget = std::make_shared<Budget>(1000);
  ASSERT_TRUE(budget->Charge(Budget::Use::kLocal, 1000));
  AnswerQueue small(budget);
  int added = 0;
  while (added < 10'000 && small.Add(Outcome(1))) ++added;
  EXPECT_GT(added, 100) << "about 64 KiB are always there";
  EXPECT_LT(added, 1000);
  EXPECT_EQ(small.size(), size_t(added));
  small.Clear();
  EXPECT_EQ(budget->used_bytes(), 1000u);
}

TEST_F(AnswerQueueTest, OutcomesThatWereNotWrittenAreGivenBack) {
  ASSERT_TRUE(queue.Add(Receipt{1, 1, Accepted{}}));
  ASSERT_TRUE(queue.Add(Outcome(1)));
  Pop();
  queue.Written();
  ASSERT_TRUE(queue.Add(Outcome(2)));
  Pop();
  ASSERT_TRUE(queue.Add(Issue{}));
  ASSERT_TRUE(queue.Add(Outcome(3)));
  const std::vector<Receipt> left = queue.TakeOutcomes();
  ASSERT_EQ(left.size(), 2u);
  EXPECT_EQ(left[0].frame_id, 2u);
  EXPECT_EQ(left[1].frame_id, 3u);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(budget->used_bytes(), 0u);
  EXPECT_TRUE(queue.TakeOutcomes().empty());
}

}  // namespace
}  // namespace voxeld::daemon::services
