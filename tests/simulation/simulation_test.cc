// Tests of the simulation itself: the same seed gives the same run, and the runs reach the
// situations that they are to judge.
#include <gtest/gtest.h>

#include <map>
#include <sstream>
#include <string>

#include "tests/simulation/simulation_run.h"

namespace voxeld::simulation {
namespace {

constexpr uint32_t kSeeds = 40;

TEST(Simulation, ASeedIsOneRun) {
  for (uint32_t seed = 1; seed <= kSeeds; ++seed) {
    std::ostringstream first, second;
    SimulationRun one(MakeScenario(seed), &first);
    SimulationRun other(MakeScenario(seed), &second);
    EXPECT_EQ(one.Run(), "") << "seed " << seed;
    EXPECT_EQ(other.Run(), "") << "seed " << seed;
    ASSERT_EQ(first.str(), second.str()) << "seed " << seed;
    EXPECT_EQ(one.trace_hash(), other.trace_hash()) << "seed " << seed;
    EXPECT_EQ(one.tally().turns, other.tally().turns) << "seed " << seed;
    EXPECT_GT(first.str().size(), 1000u) << "seed " << seed;
  }
}

TEST(Simulation, SeedsDiffer) {
  std::map<uint64_t, uint32_t> by_hash;
  for (uint32_t seed = 1; seed <= kSeeds; ++seed) {
    SimulationRun run(MakeScenario(seed));
    EXPECT_EQ(run.Run(), "") << "seed " << seed;
    EXPECT_TRUE(by_hash.emplace(run.trace_hash(), seed).second)
        << "as seed " << by_hash[run.trace_hash()];
  }
}

TEST(Simulation, AllThatIsJudgedIsMet) {
  using Kind = CommitOutcome::Kind;
  std::map<Kind, uint64_t> kinds;
  Tally sum;
  for (uint32_t seed = 1; seed <= 3 * kSeeds; ++seed) {
    SimulationRun run(MakeScenario(seed));
    EXPECT_EQ(run.Run(), "") << "seed " << seed;
    const Tally tally = run.tally();
    for (const auto& [kind, n] : tally.kinds) kinds[kind] += n;
    sum.volumes += tally.volumes;
    sum.pictures_compared += tally.pictures_compared;
    sum.captures += tally.captures;
    sum.watched += tally.watched;
    sum.faults += tally.faults;
  }
  for (const Kind kind :
       {Kind::kPresented, Kind::kUnchanged, Kind::kSuperseded, Kind::kLost, Kind::kNotShown}) {
    EXPECT_GT(kinds[kind], 20u) << static_cast<int>(kind);
  }
  EXPECT_GT(sum.volumes, 500u);
  EXPECT_GT(sum.pictures_compared, 100u);
  EXPECT_GT(sum.captures, 20u);
  EXPECT_GT(sum.watched, 100u);
  EXPECT_GT(sum.faults, 100u);
}

}  // namespace
}  // namespace voxeld::simulation
