// Receipts by hand: what a client is told of each commit, rule by rule.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Put;
using testing::RecordingSink;
using testing::SetLayer;
using testing::Simulation;
using Kind = CommitOutcome::Kind;

CommitOutcome Only(const RecordingSink& sink, uint64_t frame_id) {
  const std::vector<CommitOutcome> outcomes = sink.OutcomesOf(frame_id);
  EXPECT_EQ(outcomes.size(), 1u) << "frame " << frame_id;
  return outcomes.empty() ? CommitOutcome() : outcomes.front();
}

TEST(CoreReceipts, ACommitIsAcceptedThenPresented) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  EXPECT_THAT(client.info.displays, ::testing::ElementsAre("main"));
  sim.Send(client, 7, Put("a", "x"));
  const auto accepted = client.sink->Of<Accepted>();
  ASSERT_EQ(accepted.size(), 1u);
  EXPECT_EQ(accepted[0].first.frame_id, 7u);
  EXPECT_EQ(accepted[0].first.sequence, 2u);
  EXPECT_EQ(accepted[0].second.refused_operations, 0u);
  EXPECT_EQ(accepted[0].second.applied_time_ns, sim.clock.Now());
  EXPECT_THAT(accepted[0].second.displays, ::testing::ElementsAre("main"));
  EXPECT_TRUE(client.sink->OutcomesOf(7).empty());

  sim.clock.Advance(5 * sync::kMillisecond);
  ASSERT_TRUE(sim.Show());
  const CommitOutcome outcome = Only(*client.sink, 7);
  EXPECT_EQ(outcome.kind, Kind::kPresented);
  EXPECT_EQ(outcome.display, "main");
  EXPECT_EQ(outcome.volume, 2u);  // the first was the dark one
  EXPECT_EQ(outcome.time_ns, sim.clock.Now());
  EXPECT_EQ(outcome.evidence, display::Evidence::kDevice);
  EXPECT_EQ(outcome.last_byte_ns, sim.clock.Now() - sync::kMillisecond);
  EXPECT_EQ(sim.engine().scene->drawables().size(), 1u);
  EXPECT_FALSE(sim.Show());  // nothing else was drawn
}

}  // namespace
}  // namespace voxeld::daemon
