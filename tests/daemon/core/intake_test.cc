// Tests credit, memory and dropped frames, apart from the core.
#include "daemon/core/intake.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Begin;
using ::testing::ElementsAre;
using testing::End;
using testing::EndCommit;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Put;

constexpr uint64_t kWindow = 1000;

class IntakeTest : public ::testing::Test {
 protected:
  void Make(FlowPolicy flow = FlowPolicy::kReliable, uint32_t frames = 0) {
    OpenOptions options;
    options.flow = flow;
    options.drop_oldest_frames = frames;
    limits.credit_bytes = kWindow;
    intake.emplace(limits, budget, bytes_in, options, 10, sink, [this] { ++scheduled; });
  }

  template <typename... Ops>
  bool Take(uint64_t bytes, Ops... ops) {
    std::vector<Operation> all = testing::Sequence(sequence, std::move(ops)...);
    sequence += all.size();
    return intake->Take({std::move(all), {}, bytes, 1, 2, named_bytes});
  }

  // Returns the layers and ids of the entities that a commit would insert.
  static std::vector<std::string> Puts(const WaitingCommit& commit) {
    std::vector<std::string> puts;
    for (const Operation& operation : commit.operations) {
      if (const auto* put = std::get_if<Upsert>(&operation.op)) {
        puts.push_back(put->layer + "/" + put->id);
      }
    }
    return puts;
  }

  WaitingCommit Pop() {
    bool more = false;
    std::optional<WaitingCommit> commit = intake->Pop(&more);
    EXPECT_TRUE(commit.has_value());
    return commit.has_value() ? *std::move(commit) : WaitingCommit();
  }

  Limits limits;
  std::shared_ptr<Budget> budget = std::make_shared<Budget>(100'000);
  std::shared_ptr<std::atomic<uint64_t>> bytes_in = std::make_shared<std::atomic<uint64_t>>(0);
  std::shared_ptr<testing::RecordingSink> sink = std::make_shared<testing::RecordingSink>();
  std::optional<Intake> intake;
  uint64_t sequence = 0;
  uint64_t named_bytes = 0;  // named by the messages for Take
  int scheduled = 0;
};

TEST_F(IntakeTest, WhatIsStagedWithNothingBeforeItCostsNoCredit) {
  Make();
  EXPECT_EQ(intake->first_credit(), kWindow + 10);
  for (int i = 0; i < 10; ++i) {
    Take(400, Put("a", "x"));
    EXPECT_TRUE(intake->HasRoom());
  }
  ASSERT_FALSE(sink->credits.empty());
  EXPECT_GT(sink->credits.back(), 10 + 10 * 400 + kWindow * 3 / 4 - 1);
  EXPECT_LE(sink->credits.back(), 10 + 10 * 400 + kWindow);
  EXPECT_EQ(scheduled, 0);
  EXPECT_EQ(bytes_in->load(), 4010u);
}

TEST_F(IntakeTest, WhatIsCarriedOutOtherwiseIsToldAndNoRefusal) {
  limits.max_issues_per_commit = 2;
  Make();
  Refusals told;
  for (const bool applied : {true, false, true, false, true}) {
    told.Add({.sequence = 1, .field = "f", .message = applied ? "so" : "no", .applied = applied},
             limits.max_issues_per_commit);
  }
  EXPECT_EQ(told.more, 1u);
  EXPECT_EQ(told.more_applied, 2u);
  std::vector<Operation> all = testing::Sequence(sequence, Put("a", "x"), EndCommit(1));
  intake->Take({std::move(all), std::move(told), 10, 1, 2, 0});
  ASSERT_EQ(sink->issues.size(), 2u);
  EXPECT_TRUE(sink->issues[0].applied);
  EXPECT_FALSE(sink->issues[1].applied);
  const WaitingCommit commit = Pop();
  EXPECT_EQ(commit.refusals.refused(), 2u);
  EXPECT_EQ(commit.refusals.first(), "f: no");
}

TEST_F(IntakeTest, TheFirstRefusalIsKnownThoughNotesLeaveNoRoomForIt) {
  limits.max_issues_per_commit = 2;
  Make();
  Refusals told;
  for (const bool applied : {true, true, false, false}) {
    told.Add({.sequence = 1, .field = "f", .message = applied ? "so" : "no", .applied = applied},
             limits.max_issues_per_commit);
  }
  std::vector<Operation> all = testing::Sequence(sequence, Put("a", "x"), EndCommit(1));
  intake->Take({std::move(all), std::move(told), 10, 1, 2, 0});
  const WaitingCommit commit = Pop();
  EXPECT_EQ(commit.refusals.refused(), 2u);
  EXPECT_EQ(commit.refusals.first(), "f: no");
}

TEST_F(IntakeTest, WhatWaitsForItsTurnHoldsItsCredit) {
  Make();
  EXPECT_FALSE(Take(600, Put("a", "x"), EndCommit(1)));
  EXPECT_TRUE(intake->HasRoom());
  EXPECT_TRUE(Take(600, Put("a", "y"))) << "1200 bytes of 1000";
  EXPECT_FALSE(intake->HasRoom());
  EXPECT_FALSE(Take(1, Put("a", "z"))) << "it was full before";
  EXPECT_THAT(sink->credits, IsEmpty());
  EXPECT_EQ(scheduled, 1);
  WaitingCommit commit = Pop();
  EXPECT_EQ(sink->rooms, 0);
  intake->Done(std::move(commit));
  // Nothing waits any longer, so staged operations hold no credit either.
  EXPECT_EQ(sink->rooms, 1);
  EXPECT_EQ(sink->credits.back(), 10 + 1201 + kWindow);
  EXPECT_TRUE(intake->HasRoom());
}

TEST_F(IntakeTest, ACommitIsScheduledOnceUntilItsQueueWasEmpty) {
  Make();
  Take(1, EndCommit(1));
  Take(1, EndCommit(2));
  EXPECT_EQ(scheduled, 1);
  bool more = false;
  std::optional<WaitingCommit> one = intake->Pop(&more);
  EXPECT_TRUE(more);
  std::optional<WaitingCommit> two = intake->Pop(&more);
  EXPECT_FALSE(more);
  EXPECT_EQ(two->commit.frame_id, 2u);
  Take(1, EndCommit(3));
  EXPECT_EQ(scheduled, 2);
  intake->Done(*std::move(one));
  intake->Done(*std::move(two));
  intake->Done(Pop());
  EXPECT_FALSE(intake->Pop(&more).has_value());
}

TEST_F(IntakeTest, LatestKeepsTheNewestFrameOfEachLayerAndAllElse) {
  Make(FlowPolicy::kLatest);
  Take(100, Begin("f"), Put("f", "1"), Put("other", "1"), End("f"), EndCommit(1));
  Take(100, Begin("g"), Put("g", "1"), End("g"), Put("f", "kept"), EndCommit(2));
  Take(100, Begin("f"), Put("f", "2"), End("f"), EndCommit(3));
  Take(100, Begin("f"), Put("f", "3"), End("f"), Begin("g"), Put("g", "2"), End("g"), EndCommit(4));
  WaitingCommit one = Pop(), two = Pop(), three = Pop(), four = Pop();
  EXPECT_THAT(Puts(one), ElementsAre("other/1"));
  EXPECT_EQ(one.dropped_frames, 1u);
  EXPECT_THAT(Puts(two), ElementsAre("f/kept"));
  EXPECT_EQ(two.dropped_frames, 1u);
  EXPECT_THAT(Puts(three), IsEmpty());
  EXPECT_THAT(three.operations, IsEmpty());
  EXPECT_THAT(Puts(four), ElementsAre("f/3", "g/2"));
  EXPECT_EQ(four.dropped_frames, 0u);
}

TEST_F(IntakeTest, WhatALayerIsLikeStaysWhereverItIsSaid) {
  Make(FlowPolicy::kLatest);
  Take(10, Begin("f"), testing::SetLayer("f", false), Put("f", "1"), End("f"), EndCommit(1));
  Take(10, Begin("f"), Put("f", "2"), End("f"), EndCommit(2));
  const WaitingCommit one = Pop();
  ASSERT_EQ(one.operations.size(), 1u);
  EXPECT_TRUE(std::holds_alternative<LayerState>(one.operations[0].op));
  EXPECT_THAT(Puts(Pop()), ElementsAre("f/2"));
}

TEST_F(IntakeTest, CreditOfAFrameGivenUpReturnsAtOnce) {
  Make(FlowPolicy::kLatest);
  Take(900, Begin("f"), Put("f", "1"), End("f"), EndCommit(1));
  Take(90, EndCommit(2));
  EXPECT_THAT(sink->credits, IsEmpty());
  Take(900, Begin("f"), Put("f", "2"), End("f"), EndCommit(3));
  ASSERT_EQ(sink->credits.size(), 1u);
  EXPECT_EQ(sink->credits[0], 10 + 900 + kWindow);
  for (int i = 0; i < 3; ++i) intake->Done(Pop());
  EXPECT_EQ(sink->credits.back(), 10 + 900 + 90 + 900 + kWindow);
  EXPECT_EQ(budget->used_bytes(), 0u);
}

TEST_F(IntakeTest, DropOldestKeepsSoMany) {
  Make(FlowPolicy::kDropOldest, 2);
  for (int i = 1; i <= 5; ++i) {
    Take(10, Begin("f"), Put("f", std::to_string(i)), End("f"), EndCommit(i));
  }
  std::vector<std::string> left;
  for (int i = 0; i < 5; ++i) {
    WaitingCommit commit = Pop();
    for (const std::string& put : Puts(commit)) left.push_back(put);
    intake->Done(std::move(commit));
  }
  EXPECT_THAT(left, ElementsAre("f/4", "f/5"));
}

TEST_F(IntakeTest, AFrameUnderWayOrForItsTimeIsNotGivenUp) {
  Make(FlowPolicy::kLatest);
  Take(10, Begin("f"), Put("f", "1"), End("f"), EndCommit(1));
  WaitingCommit under_way = Pop();
  Operation timed = EndCommit(2);
  std::get<Commit>(timed.op).present_at_ns = 5;
  Take(10, Begin("f"), Put("f", "2"), End("f"), timed);
  Operation must = EndCommit(3);
  std::get<Commit>(must.op).must_show = true;
  Take(10, Begin("f"), Put("f", "3"), End("f"), must);
  Take(10, Begin("f"), Put("f", "4"), End("f"), EndCommit(4));
  EXPECT_THAT(Puts(under_way), ElementsAre("f/1"));
  EXPECT_THAT(Puts(Pop()), ElementsAre("f/2"));
  EXPECT_THAT(Puts(Pop()), ElementsAre("f/3"));
  EXPECT_THAT(Puts(Pop()), ElementsAre("f/4"));
}

TEST_F(IntakeTest, AnUnfinishedFrameStays) {
  Make(FlowPolicy::kLatest);
  Take(10, Begin("f"), Put("f", "1"), EndCommit(1));
  Take(10, Begin("f"), Put("f", "2"), End("f"), EndCommit(2));
  EXPECT_THAT(Puts(Pop()), ElementsAre("f/1")) << "it is refused when applied, with an issue";
}

TEST_F(IntakeTest, TheBudgetIsALimitForAll) {
  budget = std::make_shared<Budget>(2000);
  Make();
  int taken = 0;
  while (sink->issues.empty() && taken < 100) {
    Take(1, Put("a", "x"));
    ++taken;
  }
  ASSERT_EQ(sink->issues.size(), 1u);
  EXPECT_EQ(sink->issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_EQ(sink->issues[0].field, "upsert");
  EXPECT_EQ(sink->issues[0].layer, "a");
  EXPECT_THAT(sink->issues[0].message, HasSubstr("max_memory_bytes"));
  EXPECT_LE(budget->used_bytes(), 2000u);
  Take(1, EndCommit(1));
  WaitingCommit commit = Pop();
  EXPECT_EQ(commit.refusals.refused(), 1u);
  EXPECT_EQ(commit.operations.size(), size_t(taken) - 1);
  intake->Done(std::move(commit));
  EXPECT_EQ(budget->used_bytes(), 0u);
}

TEST_F(IntakeTest, ClosingGivesBackWhatIsStagedAndKeepsWhatWaits) {
  Make();
  Take(10, Put("a", "x"), EndCommit(1));
  Take(10, Put("a", "y"));
  EXPECT_GT(budget->used_bytes(Budget::Use::kStaged), 0u);
  intake->Close();
  EXPECT_EQ(budget->used_bytes(Budget::Use::kStaged), 0u);
  Take(10, Put("a", "z"), EndCommit(2));
  EXPECT_THAT(Puts(Pop()), ElementsAre("a/x"));
  EXPECT_TRUE(intake->empty());
}

TEST_F(IntakeTest, WhatWaitsIsGivenBackAtTheEnd) {
  Make();
  Take(10, Put("a", "x"), EndCommit(1));
  Take(10, Put("a", "y"));
  intake.reset();
  EXPECT_EQ(budget->used_bytes(), 0u);
}

TEST_F(IntakeTest, ATimedCommitHoldsNoCreditButMemory) {
  Make();
  Take(900, Put("a", "x"), EndCommit(1));
  WaitingCommit commit = Pop();
  intake->Detach(commit);
  EXPECT_EQ(sink->credits.back(), 910 + kWindow);
  EXPECT_GT(budget->used_bytes(Budget::Use::kWaiting), 0u);
  intake->Done(std::move(commit));
  EXPECT_EQ(budget->used_bytes(), 0u);
}

TEST_F(IntakeTest, LocalMemoryOfWhatWaitsHoldsReadingBack) {
  limits.max_message_bytes = 100;
  named_bytes = 150;
  Make();
  for (int i = 0; i < 10; ++i) {
    Take(1, Put("a", "x"));
    EXPECT_TRUE(intake->HasRoom()) << "nothing waits before it";
  }
  Take(1, EndCommit(1));
  Take(1, Put("a", "y"), EndCommit(2));
  named_bytes = 99;
  Take(1, Put("a", "z"));
  EXPECT_TRUE(intake->HasRoom()) << "399 bytes of 400";
  named_bytes = 1;
  Take(1, Put("a", "z"));
  EXPECT_FALSE(intake->HasRoom()) << "400 bytes of 400";
  EXPECT_THAT(sink->credits, IsEmpty()) << "this gives no credit back";

  WaitingCommit one = Pop();
  EXPECT_EQ(sink->rooms, 0);
  intake->Done(std::move(one));
  EXPECT_EQ(sink->rooms, 1);
  EXPECT_TRUE(intake->HasRoom());
  named_bytes = 1000;
  Take(1, EndCommit(3));
  EXPECT_FALSE(intake->HasRoom());
  WaitingCommit two = Pop(), three = Pop();
  intake->Done(std::move(two));
  EXPECT_FALSE(intake->HasRoom());
  // A commit that waits elsewhere for its time gives its credit back at once, and only once.
  intake->Detach(three);
  EXPECT_EQ(sink->rooms, 2);
  intake->Done(std::move(three));
  named_bytes = 399;
  Take(1, EndCommit(4));
  EXPECT_TRUE(intake->HasRoom());
  named_bytes = 1;
  Take(1, EndCommit(5));
  EXPECT_FALSE(intake->HasRoom());
  EXPECT_EQ(sink->rooms, 2);
}

TEST_F(IntakeTest, AFrameGivenUpKeepsItsLocalBytesUntilItsCommitIsDone) {
  limits.max_message_bytes = 100;
  named_bytes = 200;
  Make(FlowPolicy::kLatest);
  for (int i = 0; i < 2; ++i) {
    Take(1, Begin("a"), Put("a", "x"), End("a"), EndCommit(i));
  }
  EXPECT_FALSE(intake->HasRoom());
  WaitingCommit commit = Pop();
  EXPECT_EQ(commit.dropped_frames, 1u);
  EXPECT_FALSE(intake->HasRoom());
  intake->Done(std::move(commit));
  EXPECT_EQ(sink->rooms, 1);
}

TEST_F(IntakeTest, CommitsThatWaitAreLimitedInNumber) {
  limits.max_riding_commits = 3;
  Make();
  for (int i = 0; i < 3; ++i) Take(1, EndCommit(i));
  EXPECT_FALSE(intake->HasRoom());
  intake->Done(Pop());
  EXPECT_EQ(sink->rooms, 1);
}

TEST(RefusalTally, NamesAreDescribedInPrintableText) {
  const Issue issue{.layer = "a\n", .id = "b\x1b", .field = "upsert", .message = "is wrong"};
  EXPECT_EQ(RefusalTally::Describe(issue), "a\\n/b\\x1b, upsert: is wrong");
}

}  // namespace
}  // namespace voxeld::daemon
