// Compares the functions of expressions with double precision.
#include "gpu/implicit/number.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace voxeld::gpu::implicit {
namespace {

constexpr double kError = 0x1p-21;

// Numbers of all magnitudes, and from the middle of the range.
class Samples {
 public:
  float Next() {
    const double exponent = std::uniform_real_distribution<double>(-30, 30)(random_);
    const double value = std::exp2(exponent);
    return static_cast<float>(random_() % 2 == 0 ? value : -value);
  }
  float Within(double low, double high) {
    return static_cast<float>(std::uniform_real_distribution<double>(low, high)(random_));
  }

 private:
  std::mt19937_64 random_{7};
};

void ExpectRelative(double got, double want, float x) {
  ASSERT_LE(std::fabs(got - want), std::fabs(want) * kError + 1e-44) << "at " << x;
}
void ExpectAbsolute(double got, double want, float x) {
  ASSERT_LE(std::fabs(got - want), kError) << "at " << x;
}

TEST(Number, SineAndCosineAreWithinTheirError) {
  Samples samples;
  for (int i = 0; i < 300'000; ++i) {
    const float x = i % 3 == 0   ? samples.Within(-7, 7)
                    : i % 3 == 1 ? samples.Within(-9000, 9000)
                                 : samples.Within(-kMostAngle, kMostAngle);
    ExpectAbsolute(Sin(x), std::sin(double{x}), x);
    ExpectAbsolute(Cos(x), std::cos(double{x}), x);
    if (HasFatalFailure()) return;
  }
  EXPECT_TRUE(IsNan(Sin(2 * kMostAngle)));
  EXPECT_TRUE(IsNan(Cos(-Infinity())));
  EXPECT_EQ(Sin(0), 0);
  EXPECT_EQ(Cos(0), 1);
}

TEST(Number, ExponentialsAndLogarithmsAreWithinTheirError) {
  Samples samples;
  for (int i = 0; i < 300'000; ++i) {
    const float x = samples.Within(-87, 88.7);
    ExpectRelative(Exp(x), std::exp(double{x}), x);
    const float y = Abs(samples.Next());
    // Absolute where the logarithm is small, since its argument was already rounded.
    ASSERT_LE(std::fabs(Log(y) - std::log(double{y})),
              kError * std::max(1e-3, std::fabs(std::log(double{y}))))
        << "at " << y;
    if (HasFatalFailure()) return;
  }
  for (float x : {-200.0f, -104.5f, -100.0f, -90.0f}) {
    EXPECT_NEAR(Exp(x), std::exp(double{x}), 3e-45) << x;
  }
  EXPECT_EQ(Exp(89), Infinity());
  EXPECT_EQ(Exp(0), 1);
  EXPECT_EQ(Log(1), 0);
  EXPECT_EQ(Log(0), -Infinity());
  EXPECT_TRUE(IsNan(Log(-1)));
  EXPECT_NEAR(Log(1e-44f), std::log(double{1e-44f}), 1e-4);
  EXPECT_EQ(Log(Infinity()), Infinity());
}

TEST(Number, RootsAndPowersAreWithinTheirError) {
  Samples samples;
  for (int i = 0; i < 100'000; ++i) {
    const float x = samples.Next();
    ExpectRelative(Cbrt(x), std::cbrt(double{x}), x);
    const float y = samples.Within(-3, 3);
    const int n = i % 12 - 4;
    ExpectRelative(PowI(y, n), std::pow(double{y}, n), y);
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(PowI(0, 0), 1);
  EXPECT_EQ(PowI(-2, 3), -8);
  EXPECT_EQ(PowI(-2, -1), -0.5f);
  EXPECT_TRUE(IsNan(Sqrt(-1)));
}

TEST(Number, AnglesAreWithinTheirError) {
  Samples samples;
  for (int i = 0; i < 300'000; ++i) {
    const float y = samples.Next(), x = samples.Next();
    ExpectAbsolute(Atan2(y, x), std::atan2(double{y}, double{x}), y);
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(Atan2(0, 0), 0);
  EXPECT_NEAR(Atan2(1, 0), std::acos(-1.0) / 2, kError);
  EXPECT_NEAR(Atan2(0, -1), std::acos(-1.0), kError);
}

TEST(Number, FloorIsThatOfTheLibrary) {
  Samples samples;
  for (int i = 0; i < 100'000; ++i) {
    const float x = samples.Next();
    ASSERT_EQ(Floor(x), std::floor(x));
  }
}

TEST(Number, WhatIsNoNumberIsOutside) {
  const float nan = NotANumber();
  EXPECT_EQ(Min(nan, 2), 2);
  EXPECT_EQ(Min(2, nan), 2);
  EXPECT_TRUE(IsNan(Max(nan, 2)));
  EXPECT_TRUE(IsNan(Max(2, nan)));
}

}  // namespace
}  // namespace voxeld::gpu::implicit
