#include "display/geometry/angle.h"

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace voxeld::display {
namespace {

constexpr long double kTurnToRadian = 2 * std::numbers::pi_v<long double> / 4294967296.0L;
constexpr long double kUnit = 1073741824.0L;  // 2³⁰
constexpr Turn kQuarter = Turn{1} << 30;

TEST(AngleTest, DirectionsAgreeWithTheMathsLibrary) {
  std::mt19937 random(1);
  long double worst = 0;
  for (int n = 0; n < 200000; ++n) {
    const Turn turn = random();
    const Direction d = DirectionOf(turn);
    const long double angle = turn * kTurnToRadian;
    worst = std::max(worst, std::abs(d.cos - std::cos(angle) * kUnit));
    worst = std::max(worst, std::abs(d.sin - std::sin(angle) * kUnit));
  }
  EXPECT_LT(worst, 0.51L);
  EXPECT_GT(worst, 0.45L);  // the best possible rounding is to the nearest
}

TEST(AngleTest, QuarterTurnsAreExact) {
  constexpr int32_t kOne = 1 << 30;
  const Direction expected[] = {{kOne, 0}, {0, kOne}, {-kOne, 0}, {0, -kOne}};
  for (Turn q = 0; q < 4; ++q) {
    EXPECT_EQ(DirectionOf(q * kQuarter).cos, expected[q].cos) << q;
    EXPECT_EQ(DirectionOf(q * kQuarter).sin, expected[q].sin) << q;
  }
}

TEST(AngleTest, DirectionsHaveTheSymmetriesOfTheCircle) {
  std::mt19937 random(2);
  for (int n = 0; n < 10000; ++n) {
    const Turn turn = random();
    const Direction d = DirectionOf(turn);
    const Direction quarter_on = DirectionOf(turn + kQuarter);
    ASSERT_EQ(quarter_on.cos, -d.sin);
    ASSERT_EQ(quarter_on.sin, d.cos);
    const Direction opposite = DirectionOf(Turn{0} - turn);
    ASSERT_EQ(opposite.cos, d.cos);
    ASSERT_EQ(opposite.sin, -d.sin);
  }
}

TEST(AngleTest, EveryAngleNearAnOctantsEndAgrees) {
  for (Turn end = 0; end < 8; ++end) {
    for (int32_t off = -50; off <= 50; ++off) {
      const Turn turn = end * (Turn{1} << 29) + static_cast<Turn>(off);
      const Direction d = DirectionOf(turn);
      ASSERT_LT(std::abs(d.cos - std::cos(turn * kTurnToRadian) * kUnit), 0.51L) << turn;
      ASSERT_LT(std::abs(d.sin - std::sin(turn * kTurnToRadian) * kUnit), 0.51L) << turn;
    }
  }
}

TEST(AngleTest, TurnsAgreeWithTheMathsLibrary) {
  std::mt19937_64 random(3);
  long double worst = 0;
  for (int n = 0; n < 200000; ++n) {
    // Numbers of all magnitudes, up to 2⁶² − 1.
    const int64_t x = static_cast<int64_t>(random()) >> (1 + random() % 60);
    const int64_t y = static_cast<int64_t>(random()) >> (1 + random() % 60);
    if (x == 0 && y == 0) continue;
    const long double exact =
        std::atan2(static_cast<long double>(y), static_cast<long double>(x)) / kTurnToRadian;
    const long double off = TurnOf(x, y) - exact;
    worst = std::max(worst, std::abs(off - 4294967296.0L * std::round(off / 4294967296.0L)));
  }
  EXPECT_LT(worst, 0.51L);
}

TEST(AngleTest, TurnsOfAxesAndDiagonalsAreExact) {
  const int64_t sizes[] = {1, 3, 65536, (int64_t{1} << 31) + 1, (int64_t{1} << 62) - 1};
  for (const int64_t r : sizes) {
    const int64_t x[] = {r, r, 0, -r, -r, -r, 0, r}, y[] = {0, r, r, r, 0, -r, -r, -r};
    for (Turn eighth = 0; eighth < 8; ++eighth) {
      EXPECT_EQ(TurnOf(x[eighth], y[eighth]), eighth << 29) << r << " " << eighth;
    }
  }
}

TEST(AngleTest, TurnsOfDirectionsComeBack) {
  std::mt19937 random(4);
  for (int n = 0; n < 10000; ++n) {
    const Turn turn = random();
    const Direction d = DirectionOf(turn);
    EXPECT_LE(std::abs(static_cast<int32_t>(TurnOf(d.cos, d.sin) - turn)), 4);
  }
}

TEST(AngleTest, TurnsFromFractionsAndRatios) {
  EXPECT_EQ(TurnFromFraction(0), 0u);
  EXPECT_EQ(TurnFromFraction(0.25), kQuarter);
  EXPECT_EQ(TurnFromFraction(0x1.8p-32), 2u);    // half up
  EXPECT_EQ(TurnFromFraction(1 - 0x1p-40), 0u);  // wraps around
  EXPECT_EQ(TurnFromRatio(1, 4), kQuarter);
  EXPECT_EQ(TurnFromRatio(1, 3), 1431655765u);
  EXPECT_EQ(TurnFromRatio(2, 3), 2863311531u);
  EXPECT_EQ(TurnFromRatio(0, 1), 0u);
}

TEST(AngleTest, SquareRootsAreExactFloors) {
  std::mt19937_64 random(5);
  for (int n = 0; n < 100000; ++n) {
    const int64_t root = static_cast<int64_t>(random() >> (33 + random() % 31));
    ASSERT_EQ(FloorSqrt(root * root), root);
    ASSERT_EQ(FloorSqrt(root * root + 2 * root), root);
    if (root > 0) {
      ASSERT_EQ(FloorSqrt(root * root - 1), root - 1);
    }
  }
}

}  // namespace
}  // namespace voxeld::display
