#include "daemon/process/end_limit.h"

#include <gtest/gtest.h>
#include <sys/time.h>
#include <unistd.h>

namespace voxeld::daemon {
namespace {

TEST(EndLimitDeathTest, WhatDoesNotEndIsEnded) {
  EXPECT_EXIT(
      {
        const EndLimit limit(20 * sync::kMillisecond);
        while (true) pause();
      },
      ::testing::ExitedWithCode(1), "did not end in time");
}

TEST(EndLimitDeathTest, WhatEndsInTimeIsLeftAlone) {
  EXPECT_EXIT(
      {
        { const EndLimit limit(20 * sync::kMillisecond); }
        itimerval left = {};
        getitimer(ITIMER_REAL, &left);
        _exit(left.it_value.tv_sec == 0 && left.it_value.tv_usec == 0 ? 7 : 8);
      },
      ::testing::ExitedWithCode(7), "");
}

}  // namespace
}  // namespace voxeld::daemon
