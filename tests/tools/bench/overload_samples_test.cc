#include "tools/bench/voxel_bench/overload_samples.h"

#include <gmock/gmock.h>

#include "absl/strings/str_split.h"

namespace voxeld::bench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

v1::Stats StatsWith(uint64_t owed) {
  v1::Stats stats;
  v1::DisplayStats* display = stats.add_displays();
  display->set_commits_owed(owed);
  display->set_commits_presented(1);
  display->set_commits_unchanged(2);
  display->set_commits_superseded(4);
  display->set_commits_lost(8);
  display->set_commits_not_shown(16);
  display->set_commits_pending(32);
  stats.mutable_memory()->set_scene_bytes(100);
  stats.mutable_memory()->set_answers_bytes(20);
  stats.mutable_memory()->set_limit_bytes(1'000'000);
  return stats;
}

TEST(OverloadSample, IsExactWhenEveryOutcomeIsCountedOnce) {
  OverloadSample sample;
  TakeStats(StatsWith(63), sample);
  EXPECT_TRUE(sample.Exact());
  EXPECT_EQ(sample.superseded, 4u);
  EXPECT_EQ(sample.pending, 32u);
  EXPECT_EQ(sample.held_bytes, 120u);
  TakeStats(StatsWith(64), sample);
  EXPECT_FALSE(sample.Exact());
  TakeStats(StatsWith(62), sample);
  EXPECT_FALSE(sample.Exact());
}

TEST(OverloadSample, RowsHaveAFieldForEveryHead) {
  OverloadSample with;
  TakeStats(StatsWith(63), with);
  with.time_s = 0.1;
  with.latency_volumes = {1, 3, 2};
  with.resident_bytes = 5000;
  OverloadSample without;
  without.time_s = 0.2;
  const std::vector<std::string> lines = absl::StrSplit(CsvOf({with, without}), '\n');
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_EQ(lines[3], "");
  const std::vector<std::string> head = absl::StrSplit(lines[0], ',');
  for (int row = 1; row <= 2; ++row) {
    const std::vector<std::string> fields = absl::StrSplit(lines[row], ',');
    EXPECT_EQ(fields.size(), head.size()) << lines[row];
  }
  EXPECT_EQ(lines[1], "0.100,0,0,0,63,1,2,4,8,16,32,1,2.000,3.000,5000,120");
  EXPECT_EQ(lines[2], "0.200,0,0,0,0,0,0,0,0,0,0,1,,,0,0");
}

TEST(OverloadSample, LatenciesAreOfTheSamplesAskedFor) {
  std::vector<OverloadSample> samples(3);
  samples[0].latency_volumes = {1, 2};
  samples[2].latency_volumes = {3};
  EXPECT_THAT(LatenciesOf(samples, 0, 3), ElementsAre(1, 2, 3));
  EXPECT_THAT(LatenciesOf(samples, 1, 99), ElementsAre(3));
  EXPECT_THAT(LatenciesOf(samples, 1, 2), IsEmpty());
}

TEST(OverloadSample, ThePlotHasLatencyAndMemory) {
  std::vector<OverloadSample> samples(2);
  samples[1].time_s = 1;
  samples[1].latency_volumes = {2};
  const std::string svg = PlotOf("ten times", samples);
  EXPECT_THAT(svg, HasSubstr("ten times"));
  EXPECT_THAT(svg, HasSubstr("volumes"));
  EXPECT_THAT(svg, HasSubstr("MB"));
}

}  // namespace
}  // namespace voxeld::bench
