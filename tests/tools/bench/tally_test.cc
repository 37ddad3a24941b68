#include "tools/bench/voxel_bench/tally.h"

#include <gmock/gmock.h>

#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/stage_times.h"

namespace voxeld::bench {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

v1::Receipt Accepted(int displays) {
  v1::Receipt receipt;
  for (int i = 0; i < displays; ++i) receipt.mutable_accepted()->add_displays("d");
  if (displays == 0) receipt.mutable_accepted();
  return receipt;
}

TEST(Tally, IsSettledWhenEverythingOwedHasCome) {
  Tally tally;
  tally.sent = 2;
  EXPECT_FALSE(tally.Settled());
  tally.Told(Accepted(2));
  tally.Told(Accepted(0));
  EXPECT_EQ(tally.owed, 2u);
  EXPECT_EQ(tally.pending(), 2u);
  EXPECT_FALSE(tally.Settled());
  v1::Receipt receipt;
  receipt.mutable_outcome()->mutable_presented();
  tally.Told(receipt);
  receipt.mutable_outcome()->mutable_superseded();
  tally.Told(receipt);
  EXPECT_TRUE(tally.Settled());
  EXPECT_TRUE(tally.Sound());
  EXPECT_EQ(ToJson(tally)["exact"], true);
  EXPECT_EQ(ToJson(tally)["superseded"], 1);
}

TEST(Tally, EachOutcomeHasItsCount) {
  Tally tally;
  v1::Receipt receipt;
  receipt.mutable_outcome()->mutable_unchanged();
  tally.Told(receipt);
  receipt.mutable_outcome()->mutable_lost();
  tally.Told(receipt);
  tally.Told(receipt);
  receipt.mutable_outcome()->mutable_not_shown();
  tally.Told(receipt);
  EXPECT_EQ(tally.unchanged, 1u);
  EXPECT_EQ(tally.lost, 2u);
  EXPECT_EQ(tally.not_shown, 1u);
  EXPECT_EQ(tally.presented, 0u);
  EXPECT_EQ(tally.outcomes(), 4u);
}

TEST(Tally, MoreThanIsOwedAndWhatIsRefusedAreNotSound) {
  Tally tally;
  tally.sent = 1;
  v1::Receipt outcome;
  outcome.mutable_outcome()->mutable_presented();
  Tally more = tally;
  more.Told(outcome);
  EXPECT_FALSE(more.Sound());

  v1::Receipt refused;
  refused.mutable_refused();
  tally.Told(refused);
  EXPECT_TRUE(tally.Settled());
  EXPECT_FALSE(tally.Sound());
  EXPECT_EQ(ToJson(tally)["exact"], false);

  Tally partly;
  partly.sent = 1;
  v1::Receipt receipt = Accepted(0);
  receipt.mutable_accepted()->set_refused_operations(3);
  partly.Told(receipt);
  EXPECT_FALSE(partly.Sound());
}

TEST(Tally, WhatIsNeitherAnswerNorOutcomeCountsNothing) {
  Tally tally;
  v1::Receipt receipt;
  receipt.mutable_scheduled();
  tally.Told(receipt);
  tally.Told({});
  EXPECT_EQ(tally.answered(), 0u);
  EXPECT_EQ(tally.outcomes(), 0u);
}

TEST(Tally, AddsUp) {
  Tally a, b;
  a.sent = 1;
  a.Told(Accepted(1));
  b = a;
  a += b;
  EXPECT_EQ(a.sent, 2u);
  EXPECT_EQ(a.accepted, 2u);
  EXPECT_EQ(a.owed, 2u);
}

TEST(StageTimes, AreFromTheStageBeforeInMilliseconds) {
  v1::Stages stages;
  stages.set_sent_ns(1);  // the daemon's estimate is not used
  stages.set_received_ns(3'000'000);
  stages.set_decoded_ns(3'500'000);
  stages.set_applied_ns(4'500'000);
  stages.set_sliced_ns(9'000'000);
  stages.set_transferred_ns(10'000'000);
  StageTimes times;
  times.Add(1'000'000, stages);
  EXPECT_THAT(times.of(0), ElementsAre(2));    // sending
  EXPECT_THAT(times.of(1), ElementsAre(0.5));  // decoding
  EXPECT_THAT(times.of(2), ElementsAre(1));    // applying
  for (const size_t unknown : {3, 4, 5, 7}) EXPECT_THAT(times.of(unknown), IsEmpty()) << unknown;
  EXPECT_THAT(times.of(6), ElementsAre(1));  // transferring
}

}  // namespace
}  // namespace voxeld::bench
