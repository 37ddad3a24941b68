#include "daemon/pipeline/sweep_outlook.h"

#include <gtest/gtest.h>

namespace voxeld::daemon {
namespace {

TEST(SweepOutlook, WithoutSweepsACommitIsDueAtItsTime) {
  SweepOutlook outlook;
  EXPECT_EQ(outlook.DueTime(1234), 1234);
  outlook.Set({1000});
  EXPECT_EQ(outlook.DueTime(1234), 1234);
  outlook.Set({1000, 1000});
  EXPECT_EQ(outlook.DueTime(1234), 1234);
}

TEST(SweepOutlook, DueJustAfterTheSweepBeforeHasBegun) {
  SweepOutlook outlook;
  outlook.Set({1000, 1800});  // then 2600, 3400 …; a margin of an eighth, 100
  EXPECT_EQ(outlook.DueTime(1001), 1000 + 100);
  EXPECT_EQ(outlook.DueTime(1800), 1000 + 100);
  EXPECT_EQ(outlook.DueTime(1801), 1800 + 100);
  EXPECT_EQ(outlook.DueTime(1000), 200 + 100);
  EXPECT_EQ(outlook.DueTime(3400), 2600 + 100);
  EXPECT_EQ(outlook.DueTime(999), 200 + 100);
  EXPECT_EQ(outlook.DueTime(200), -600 + 100);
  EXPECT_EQ(outlook.DueTime(201), 200 + 100);
}

TEST(SweepOutlook, TheMarginIsAMillisecondAtMost) {
  SweepOutlook outlook;
  const sync::TimeNs period = 50 * sync::kMillisecond;
  outlook.Set({period, 2 * period});
  EXPECT_EQ(outlook.DueTime(2 * period), period + sync::kMillisecond);
}

}  // namespace
}  // namespace voxeld::daemon
