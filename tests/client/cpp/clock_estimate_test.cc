#include "client/cpp/src/clock_estimate.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

namespace voxeld::client {
namespace {

TEST(ClockEstimator, TakesTheFastestOfTheLast) {
  ClockEstimator estimator;
  EXPECT_FALSE(estimator.Get().has_value());
  // The server's clock is 1,000,000 ahead; 40 on the way there, 5 of work, 60 on the way back: the
  // estimate is off by 10.
  estimator.Add(100, 1'000'140, 1'000'145, 205);
  ASSERT_TRUE(estimator.Get().has_value());
  EXPECT_EQ(estimator.Get()->offset_ns, 999'990);
  EXPECT_EQ(estimator.Get()->round_trip_ns, 100);
  estimator.Add(300, 1'000'310, 1'000'310, 320);
  EXPECT_EQ(estimator.Get()->offset_ns, 1'000'000);
  EXPECT_EQ(estimator.Get()->round_trip_ns, 20);
  for (size_t i = 0; i < ClockEstimator::kSamples; ++i) {
    EXPECT_EQ(estimator.Get()->round_trip_ns, 20);
    estimator.Add(1000, 1'001'200, 1'001'200, 1400);
  }
  EXPECT_EQ(estimator.Get()->round_trip_ns, 400) << "the fast one is too old by now";
  EXPECT_EQ(estimator.Get()->samples, 2 + ClockEstimator::kSamples);
}

TEST(ClockEstimator, IgnoresWhatCannotBe) {
  ClockEstimator estimator;
  estimator.Add(100, 10, 20, 90);    // received before it was sent
  estimator.Add(100, 20, 10, 200);   // answered before it was received
  estimator.Add(100, 10, 500, 200);  // longer at the server than away in total
  EXPECT_FALSE(estimator.Get().has_value());
}

TEST(ClockEstimator, IsNeverFurtherOffThanHalfTheRoundTrip) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 1000; ++round) {
    const int64_t offset = static_cast<int64_t>(random() >> 1) - (int64_t{1} << 62);
    ClockEstimator estimator;
    int64_t now = static_cast<int64_t>(random() % 1'000'000);
    for (int i = 0; i < 30; ++i) {
      const int64_t there = static_cast<int64_t>(random() % 10'000),
                    work = static_cast<int64_t>(random() % 1'000),
                    back = static_cast<int64_t>(random() % 10'000);
      estimator.Add(now, now + there + offset, now + there + work + offset,
                    now + there + work + back);
      now += 1'000'000;
    }
    const ClockEstimate estimate = *estimator.Get();
    EXPECT_LE(std::abs(estimate.offset_ns - offset), estimate.round_trip_ns / 2 + 2);
  }
}

}  // namespace
}  // namespace voxeld::client
