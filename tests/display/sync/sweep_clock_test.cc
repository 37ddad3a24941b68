#include "display/sync/sweep_clock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace voxeld::sync {
namespace {

constexpr TimeNs kPeriod = 33 * kMillisecond;
using State = SweepLock::State;

// Reports every sweep in time.
void Follow(SweepClock& clock, uint64_t first, uint64_t last, TimeNs begin = 0) {
  for (uint64_t n = first; n <= last; ++n) {
    clock.Note(n, begin + static_cast<TimeNs>(n) * kPeriod, kPeriod);
  }
}

TEST(SweepClock, KnowsAtOnceAndLocksAfterEightGoodReports) {
  SweepClock clock(kPeriod);
  EXPECT_EQ(clock.lock().state, State::kUnknown);
  EXPECT_TRUE(clock.Coming(0, 2).empty());
  Follow(clock, 1, 1);
  EXPECT_EQ(clock.lock().state, State::kLocking);
  EXPECT_EQ(clock.Coming(kPeriod, 2), (std::vector<TimeNs>{2 * kPeriod, 3 * kPeriod}));
  Follow(clock, 2, 8);
  EXPECT_EQ(clock.lock().state, State::kLocking);
  Follow(clock, 9, 9);
  EXPECT_EQ(clock.lock().state, State::kLocked);
  EXPECT_EQ(clock.Coming(9 * kPeriod - 1, 1), std::vector<TimeNs>{9 * kPeriod});
  EXPECT_EQ(clock.Coming(9 * kPeriod, 1), std::vector<TimeNs>{10 * kPeriod});
  EXPECT_EQ(clock.Nearest(20 * kPeriod + kPeriod / 3), 20u);
  EXPECT_EQ(clock.Nearest(20 * kPeriod + kPeriod * 2 / 3), 21u);
  EXPECT_EQ(clock.Nearest(-kPeriod), 1u);
  EXPECT_EQ(clock.StartOf(100), 100 * kPeriod);
}

// A screen that is 200 ppm fast, whose reports are late by up to a hundredth of a period, and of
// which a third is lost.
TEST(SweepClock, FollowsADriftThroughJitterAndLoss) {
  SweepClock clock(kPeriod);
  std::mt19937 random(1);
  const double period = kPeriod / 1.0002;
  double worst = 0;
  for (uint64_t n = 1; n <= 3000; ++n) {
    const auto begin = static_cast<double>(n) * period;
    if (n > 500) {
      worst = std::max(worst, std::abs(static_cast<double>(clock.StartOf(n)) - begin));
      EXPECT_EQ(clock.lock().state, State::kLocked) << n;
    }
    if (random() % 3 == 0) continue;
    const double late = static_cast<double>(random() % 1000) / 1000 * kPeriod / 100;
    clock.Note(n, std::llround(begin + late), kPeriod);
  }
  EXPECT_LT(worst, kPeriod / 100.0);
  EXPECT_NEAR(clock.lock().drift_ppm, 200, 800);  // the drift at one moment
  EXPECT_NEAR(clock.lock().period_ns, period, kPeriod * 1e-3);
  EXPECT_LT(clock.lock().jitter_ns, kPeriod / 100.0);
  EXPECT_GT(clock.lock().jitter_ns, 0);
  EXPECT_EQ(clock.lock().losses, 0u);
}

TEST(SweepClock, AJumpIsALossAndTheNextLockFollows) {
  SweepClock clock(kPeriod);
  Follow(clock, 1, 20);
  ASSERT_EQ(clock.lock().state, State::kLocked);
  Follow(clock, 21, 21, kPeriod / 2);
  EXPECT_EQ(clock.lock().state, State::kLocking);
  EXPECT_EQ(clock.lock().losses, 1u);
  EXPECT_EQ(clock.StartOf(22), 22 * kPeriod + kPeriod / 2);
  Follow(clock, 22, 40, kPeriod / 2);
  EXPECT_EQ(clock.lock().state, State::kLocked);
  EXPECT_EQ(clock.lock().losses, 1u);
  // A jump while locking does not count as a jump.
  Follow(clock, 41, 41, 0);
  Follow(clock, 42, 42, kPeriod / 2);
  EXPECT_EQ(clock.lock().losses, 2u);
}

TEST(SweepClock, SilenceIsALossOnce) {
  SweepClock clock(kPeriod);
  Follow(clock, 1, 20);
  const TimeNs last = 20 * kPeriod;
  clock.Advance(last + 8 * kPeriod);
  EXPECT_EQ(clock.lock().state, State::kLocked);
  clock.Advance(last + 8 * kPeriod + 1000);
  EXPECT_EQ(clock.lock().state, State::kUnknown);
  EXPECT_TRUE(clock.Coming(last, 1).empty());
  clock.Advance(last + 20 * kPeriod);
  EXPECT_EQ(clock.lock().losses, 1u);
  // A new session restarts its numbers.
  Follow(clock, 1, 9, 100 * kPeriod);
  EXPECT_EQ(clock.lock().state, State::kLocked);
  clock.Restart();
  EXPECT_EQ(clock.lock().state, State::kUnknown);
  EXPECT_EQ(clock.lock().losses, 1u) << "the end of a session is not a loss";
}

TEST(SweepClock, NonsenseIsPassedOver) {
  SweepClock clock(kPeriod);
  for (const TimeNs period : {TimeNs{0}, TimeNs{-5}, TimeNs{1}, kPeriod * 5, kPeriod / 5, kNever}) {
    clock.Note(1, 0, period);
    EXPECT_FALSE(clock.known()) << period;
  }
  clock.Note(UINT64_MAX, 0, kPeriod);
  clock.Note(0, 0, kPeriod);
  EXPECT_FALSE(clock.known());
  Follow(clock, 5, 20);
  Follow(clock, 5, 20);  // numbers that do not ascend
  EXPECT_EQ(clock.lock().state, State::kLocked);
  EXPECT_EQ(clock.StartOf(21), 21 * kPeriod);
  // The period stays near the nominal one, and predictions are made, whatever a device reports.
  std::mt19937_64 random(3);
  uint64_t number = 20;
  for (int i = 0; i < 100000; ++i) {
    number += random() % 1000;
    const TimeNs start =
        static_cast<TimeNs>(number) * kPeriod + static_cast<TimeNs>(random() % kPeriod);
    clock.Note(number, start, kPeriod / 4 + static_cast<TimeNs>(random() % (4 * kPeriod)));
    if (!clock.known()) continue;
    EXPECT_GE(clock.lock().period_ns, kPeriod / 4.0);
    EXPECT_LE(clock.lock().period_ns, kPeriod * 4.0);
    const std::vector<TimeNs> coming = clock.Coming(start, 2);
    ASSERT_EQ(coming.size(), 2u);
    EXPECT_GT(coming[0], start);
    EXPECT_LE(coming[0], start + std::llround(2 * clock.lock().period_ns));
  }
}

}  // namespace
}  // namespace voxeld::sync
