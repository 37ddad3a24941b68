// Intervals contain the results of single precision: random programs at random points of random
// boxes, with their gradients.
#include "gpu/implicit/interval.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "gpu/implicit/dual.h"
#include "gpu/implicit/program.h"
#include "tests/conformance/program_generator.h"

namespace voxeld::gpu::implicit {
namespace {

using conformance::ModelGeometry;
using conformance::SceneGenerator;

TEST(Interval, HoldsWhatFunctionsGive) {
  std::mt19937_64 random(3);
  const auto real = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto number = [&] {
    const double x = std::exp2(real(-20, 20));
    return static_cast<float>(random() % 2 == 0 ? x : -x);
  };
  uint64_t judged = 0;
  for (int i = 0; i < 200'000; ++i) {
    const auto interval = [&] {
      const float a = number(),
                  b = random() % 2 == 0 ? number() : a + static_cast<float>(real(0, 3));
      return a < b ? Interval{a, b, false} : Interval{b, a, false};
    };
    const Interval a = interval(), b = interval();
    const auto within = [&](const Interval& of) {
      switch (random() % 4) {
        case 0:
          return of.lo;
        case 1:
          return of.hi;
        default:
          return std::min(of.hi, std::max(of.lo, static_cast<float>(real(of.lo, of.hi))));
      }
    };
    const float x = within(a), y = within(b);
    const int n = static_cast<int>(random() % 12) - 4;
    const std::pair<Interval, float> pairs[] = {
        {Neg(a), Neg(x)},       {Abs(a), Abs(x)},         {Square(a), Square(x)},
        {Sqrt(a), Sqrt(x)},     {Cbrt(a), Cbrt(x)},       {Sin(a), Sin(x)},
        {Cos(a), Cos(x)},       {Exp(a), Exp(x)},         {Log(a), Log(x)},
        {Floor(a), Floor(x)},   {PowI(a, n), PowI(x, n)}, {Add(a, b), Add(x, y)},
        {Sub(a, b), Sub(x, y)}, {Mul(a, b), Mul(x, y)},   {Div(a, b), Div(x, y)},
        {Min(a, b), Min(x, y)}, {Max(a, b), Max(x, y)},   {Atan2(a, b), Atan2(x, y)}};
    for (size_t f = 0; f < std::size(pairs); ++f) {
      ++judged;
      ASSERT_TRUE(pairs[f].first.Has(pairs[f].second))
          << "function " << f << " of " << x << " in [" << a.lo << ", " << a.hi << "] and " << y
          << " in [" << b.lo << ", " << b.hi << "], n = " << n << ": " << pairs[f].second
          << " is not in [" << pairs[f].first.lo << ", " << pairs[f].first.hi << "]";
    }
  }
  EXPECT_EQ(judged, 200'000u * 18);
}

TEST(Interval, IsTightWhereItCanBe) {
  const Interval a{-1, 2, false};
  EXPECT_EQ(Square(a).lo, 0);
  EXPECT_EQ(Square(a).hi, 4);
  EXPECT_EQ(Abs(a).hi, 2);
  EXPECT_EQ(Add(a, a).hi, 4);
  EXPECT_NEAR(Sin(Interval{0, 1, false}).hi, std::sin(1.0), 1e-5);
  EXPECT_NEAR(Sin(Interval{1, 2, false}).hi, 1, 1e-5);
  EXPECT_NEAR(Sin(Interval{1, 2, false}).lo, std::sin(1.0), 1e-5);
  EXPECT_NEAR(Cos(Interval{3, 3.3f, false}).lo, -1, 1e-5);
  EXPECT_FALSE(Sqrt(Interval{1, 4, false}).nan);
  EXPECT_TRUE(Sqrt(a).nan);
}

// Programs, values and gradients, over boxes.
TEST(Interval, HoldsWhatProgramsGive) {
  uint64_t informative = 0, judged = 0;
  for (uint64_t seed = 0; seed < 3000; ++seed) {
    SceneGenerator random(seed);
    ModelGeometry g;
    conformance::AddProgram(random, 20, g);
    const ProgramView program{g.indices.data()};
    Interval box[3];
    Dual<Interval> dual_box[3];
    float gradient[3][3];
    for (int a = 0; a < 3; ++a) {
      const float lo = static_cast<float>(random.Real(-5, 25));
      box[a] = {
          lo, lo + static_cast<float>(random.Chance(0.5) ? random.Real(0, 1) : random.Real(0, 10)),
          false};
      for (int c = 0; c < 3; ++c) gradient[a][c] = static_cast<float>(random.Real(-2, 2));
      dual_box[a].value = box[a];
      for (int c = 0; c < 3; ++c) dual_box[a].d[c] = ConstantLike(box[a], gradient[a][c]);
    }
    Interval slots[kMostSlots];
    implicit::Run(program.surface_code(), program.surface(), box, 0.7f, slots);
    const Interval p = slots[program.surface_slot()];
    Dual<Interval> dual_slots[kMostSlots];
    implicit::Run(program.surface_code(), program.surface(), dual_box, 0.7f, dual_slots);
    const Dual<Interval> dp = dual_slots[program.surface_slot()];
    informative += IsFinite(p.lo) || IsFinite(p.hi);
    for (int i = 0; i < 40; ++i) {
      float at[3];
      Dual<float> dual[3];
      for (int a = 0; a < 3; ++a) {
        at[a] = random.Chance(0.2)   ? box[a].lo
                : random.Chance(0.2) ? box[a].hi
                                     : static_cast<float>(random.Real(box[a].lo, box[a].hi));
        at[a] = std::min(box[a].hi, std::max(box[a].lo, at[a]));
        dual[a] = {at[a], {gradient[a][0], gradient[a][1], gradient[a][2]}};
      }
      Dual<float> values[kMostSlots];
      implicit::Run(program.surface_code(), program.surface(), dual, 0.7f, values);
      const Dual<float>& value = values[program.surface_slot()];
      float plain[kMostSlots];
      implicit::Run(program.surface_code(), program.surface(), at, 0.7f, plain);
      ASSERT_EQ(BitsOf(plain[program.surface_slot()]) & 0x7FFFFFFF,
                BitsOf(value.value) & 0x7FFFFFFF);
      ++judged;
      ASSERT_TRUE(p.Has(value.value)) << "seed " << seed << ": " << value.value << " is not in ["
                                      << p.lo << ", " << p.hi << "]";
      ASSERT_TRUE(dp.value.Has(value.value)) << "seed " << seed;
      for (int a = 0; a < 3; ++a) {
        ASSERT_TRUE(dp.d[a].Has(value.d[a]))
            << "seed " << seed << ": " << value.d[a] << " is not in [" << dp.d[a].lo << ", "
            << dp.d[a].hi << "]";
      }
    }
  }
  EXPECT_GT(informative, 2000u);
  EXPECT_EQ(judged, 3000u * 40);
}

}  // namespace
}  // namespace voxeld::gpu::implicit
