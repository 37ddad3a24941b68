#include "daemon/process/end_limit.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>

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

void EndWithAFullPipe() {
  int ends[2];
  if (pipe(ends) != 0 || fcntl(ends[1], F_SETFL, O_NONBLOCK) != 0) _exit(9);
  const std::array<char, 4096> full{};
  while (write(ends[1], full.data(), full.size()) > 0) {
  }
  fcntl(ends[1], F_SETFL, 0);
  dup2(ends[1], STDERR_FILENO);
  const EndLimit limit(20 * sync::kMillisecond);
  while (true) pause();
}

TEST(EndLimitDeathTest, ThoughNobodyReadsWhatItSays) {
  EXPECT_EXIT(EndWithAFullPipe(), ::testing::ExitedWithCode(1), "");
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
