#include "tools/bench/samples.h"

#include <gmock/gmock.h>

namespace voxeld::bench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

void ExpectQuartiles(const std::vector<int64_t>& times, int64_t low, int64_t median, int64_t high) {
  const Quartiles q = QuartilesOf(times);
  EXPECT_EQ(q.low_ns, low);
  EXPECT_EQ(q.median_ns, median);
  EXPECT_EQ(q.high_ns, high);
}

TEST(Samples, QuartilesAreThoseOfTheSortedTimes) {
  ExpectQuartiles({7}, 7, 7, 7);
  ExpectQuartiles({40, 20}, 20, 30, 40);
  ExpectQuartiles({30, 10, 20}, 15, 20, 25);
  ExpectQuartiles({4, 1, 3, 2}, 1, 2, 3);  // means of whole nanoseconds, rounded down
  ExpectQuartiles({50, 10, 40, 20, 30}, 20, 30, 40);
  ExpectQuartiles({10, 20, 30, 40, 50, 60, 70}, 25, 40, 55);
}

const std::vector<Row> kRows = {{"lines", "cpu", "cpu", {2'000'000, 1'000'000, 3'000'000}},
                                {"lines", "cpu_worker", "cpu", {3'000'000}},
                                {"other", "cpu_worker", "cpu", {3'000'000}}};

TEST(Samples, RatiosAreToTheBaselineOfTheSameScene) {
  EXPECT_FALSE(RatioOf(kRows[0], kRows).has_value());
  EXPECT_DOUBLE_EQ(RatioOf(kRows[1], kRows).value_or(0), 1.5);
  EXPECT_FALSE(RatioOf(kRows[2], kRows).has_value());
}

TEST(Samples, TablesAndJsonSayTheSame) {
  const std::string table = TableOf(kRows);
  EXPECT_THAT(table, HasSubstr("| lines | cpu | 2 | 1.5 to 2.5 | – |\n"));
  EXPECT_THAT(table, HasSubstr("| lines | cpu_worker | 3 | 3 to 3 | 1.50 of cpu |\n"));
  const std::string json = JsonOf(kRows);
  EXPECT_THAT(json, HasSubstr(R"("engine": "cpu_worker", "baseline": "cpu", "low_ns": 3000000)"));
  EXPECT_THAT(json, HasSubstr(R"("ratio": 1.5000, "times_ns": [3000000]},)"));
  EXPECT_THAT(json, HasSubstr(R"("times_ns": [2000000, 1000000, 3000000])"));
  EXPECT_THAT(json, Not(HasSubstr("},\n]")));
}

TEST(Samples, ListsAreSplitAtCommas) {
  EXPECT_THAT(SplitList("cpu,cpu_worker"), ElementsAre("cpu", "cpu_worker"));
  EXPECT_THAT(SplitList(",cpu,"), ElementsAre("cpu"));
  EXPECT_THAT(SplitList(""), IsEmpty());
}

}  // namespace
}  // namespace voxeld::bench
