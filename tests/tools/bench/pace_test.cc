#include "tools/bench/voxel_bench/pace.h"

#include <gtest/gtest.h>

#include "tools/bench/voxel_bench/credit.h"

namespace voxeld::bench {
namespace {

using sync::kMillisecond;
using sync::kSecond;

TEST(Pace, TheFirstIsDueAtTheStart) {
  Pace pace(1000, 200);
  EXPECT_EQ(pace.due(), 1000);
  EXPECT_EQ(pace.Take(999), 0u);
  EXPECT_EQ(pace.Take(1000), 1u);
  EXPECT_EQ(pace.due(), 1000 + 5 * kMillisecond);
  EXPECT_EQ(pace.Take(1000), 0u);
}

TEST(Pace, WhoComesLateFindsThemAllAndNoneIsMoved) {
  Pace pace(0, 200);
  EXPECT_EQ(pace.Take(0), 1u);
  EXPECT_EQ(pace.Take(23 * kMillisecond), 4u);  // 5, 10, 15, 20
  EXPECT_EQ(pace.due(), 25 * kMillisecond);
  EXPECT_EQ(pace.Take(25 * kMillisecond), 1u);
  EXPECT_EQ(pace.count(), 6u);
}

TEST(Pace, CountsWhatIsDueHoweverItIsAskedFor) {
  for (const double rate : {0.7, 3.0, 600.0, 999.9, 7919.0}) {
    // In one step of a thousand seconds, and in steps of each rate's own interval.
    Pace once(17, rate), each(17, rate);
    const sync::TimeNs end = 17 + 1000 * kSecond;
    const uint64_t all = once.Take(end);
    EXPECT_GT(once.due(), end);
    uint64_t sum = 0;
    while (each.due() <= end) {
      const uint64_t taken = each.Take(each.due());
      ASSERT_EQ(taken, 1u) << rate << " " << each.count();
      sum += taken;
    }
    EXPECT_EQ(sum, all) << rate;
    EXPECT_NEAR(static_cast<double>(all), 1000 * rate + 1, 1) << rate;
  }
}

TEST(Credit, NoneToldMeansNoPacing) {
  Credit credit;
  EXPECT_TRUE(credit.MaySend());
  credit.Sent(1 << 30);
  EXPECT_TRUE(credit.MaySend());
}

TEST(Credit, AMessageMayExceedWhatIsLeftButNotFollowWhenNoneIs) {
  Credit credit;
  credit.Sent(40);  // Open, before any credit was announced
  credit.Told(100);
  EXPECT_TRUE(credit.MaySend());
  EXPECT_TRUE(credit.MaySendAfter(59));
  EXPECT_FALSE(credit.MaySendAfter(60));
  credit.Sent(1000);
  EXPECT_FALSE(credit.MaySend());
  credit.Told(1040);
  EXPECT_FALSE(credit.MaySend());
  credit.Told(1041);
  EXPECT_TRUE(credit.MaySend());
}

TEST(Credit, NeverBecomesLess) {
  Credit credit;
  credit.Told(100);
  credit.Told(0);  // an answer without credit
  credit.Told(50);
  EXPECT_EQ(credit.credit(), 100u);
}

}  // namespace
}  // namespace voxeld::bench
