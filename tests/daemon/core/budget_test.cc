#include "daemon/core/budget.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace voxeld::daemon {
namespace {

using Use = Budget::Use;

TEST(Budget, ChargesUpToTheLimitAndNoFurther) {
  Budget budget(100);
  EXPECT_TRUE(budget.Charge(Use::kStaged, 60));
  EXPECT_FALSE(budget.Charge(Use::kAnswers, 41));
  EXPECT_TRUE(budget.Charge(Use::kAnswers, 40));
  EXPECT_FALSE(budget.Charge(Use::kStaged, 1));
  EXPECT_TRUE(budget.Charge(Use::kStaged, 0));
  EXPECT_EQ(budget.used_bytes(), 100u);
  EXPECT_EQ(budget.used_bytes(Use::kStaged), 60u);
  EXPECT_FALSE(budget.Charge(Use::kStaged, UINT64_MAX));
  budget.Release(Use::kStaged, 60);
  EXPECT_TRUE(budget.Charge(Use::kOwed, 60));
}

TEST(Budget, MovesAndSetsKeepTheSum) {
  Budget budget(1000);
  ASSERT_TRUE(budget.Charge(Use::kStaged, 300));
  budget.Move(Use::kStaged, Use::kWaiting, 100);
  EXPECT_EQ(budget.used_bytes(Use::kStaged), 200u);
  EXPECT_EQ(budget.used_bytes(Use::kWaiting), 100u);
  budget.Set(Use::kScene, 500);
  EXPECT_EQ(budget.used_bytes(), 800u);
  budget.Set(Use::kScene, 50);
  EXPECT_EQ(budget.used_bytes(), 350u);
  budget.ChargeAnyway(Use::kOwed, 5000);
  EXPECT_EQ(budget.used_bytes(), 5350u);
  EXPECT_FALSE(budget.Charge(Use::kStaged, 1));
}

TEST(Budget, TellsItsPeakSinceItWasAskedLast) {
  Budget budget(100);
  ASSERT_TRUE(budget.Charge(Use::kStaged, 60));
  EXPECT_FALSE(budget.Charge(Use::kStaged, 50));
  budget.Release(Use::kStaged, 60);
  EXPECT_EQ(budget.TakePeakBytes(), 60u) << "a refused request does not count";
  EXPECT_EQ(budget.TakePeakBytes(), 0u);
  budget.Set(Use::kEngines, 40);
  budget.Set(Use::kEngines, 30);
  budget.ChargeAnyway(Use::kOwed, 90);
  budget.Release(Use::kOwed, 85);
  EXPECT_EQ(budget.TakePeakBytes(), 120u);
  EXPECT_EQ(budget.TakePeakBytes(), 35u) << "what is held";
}

TEST(Budget, ThreadsTogetherNeverPassTheLimit) {
  Budget budget(1000);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 10'000; ++i) {
        if (!budget.Charge(Use::kStaged, 300)) continue;
        EXPECT_LE(budget.used_bytes(), 1000u);
        budget.Release(Use::kStaged, 300);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(budget.used_bytes(), 0u);
  EXPECT_EQ(budget.used_bytes(Use::kStaged), 0u);
}

}  // namespace
}  // namespace voxeld::daemon
