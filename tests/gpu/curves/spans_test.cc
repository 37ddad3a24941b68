// Tests Béziers that represent arcs, helices and splines: their distance from those, in closed
// form.
#include "gpu/curves/spans.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "gpu/primitives/helix.h"
#include "gpu/primitives/spline.h"
#include "gtest/gtest.h"

namespace voxeld::gpu {
namespace {

using implicit::Vector;

Vector On(const Spans& spans, size_t span, double t) {
  const Vector* p = &spans.points()[span * 4];
  const double s = 1 - t;
  return s * s * s * p[0] + 3 * s * s * t * p[1] + 3 * s * t * t * p[2] + t * t * t * p[3];
}

void ExpectThatTheyMeet(const Spans& spans) {
  for (size_t i = 1; i < spans.size(); ++i) {
    EXPECT_LT(implicit::Length(On(spans, i, 0) - On(spans, i - 1, 1)), 1e-12) << i;
  }
}

TEST(Spans, AnArcIsRound) {
  for (const double sweep : {0.01, 1.0, -2.0, 2 * std::numbers::pi, -2 * std::numbers::pi}) {
    Spans spans;
    spans.Arc({1, 2, 3}, {5, 0, 0}, {0, 5, 0}, 0.3, sweep);
    ExpectThatTheyMeet(spans);
    double worst = 0;
    for (size_t i = 0; i < spans.size(); ++i) {
      for (int k = 0; k <= 32; ++k) {
        const Vector d = On(spans, i, k / 32.0) - Vector{1, 2, 3};
        EXPECT_EQ(d.z, 0);
        worst = std::max(worst, std::fabs(std::hypot(d.x, d.y) / 5 - 1));
      }
    }
    EXPECT_LT(worst, 7e-8);
    const Vector end = On(spans, spans.size() - 1, 1) - Vector{1, 2, 3};
    EXPECT_NEAR(end.x, 5 * std::cos(0.3 + sweep), 1e-9);
    EXPECT_NEAR(end.y, 5 * std::sin(0.3 + sweep), 1e-9);
  }
  Spans whole;
  whole.Arc({}, {1, 0, 0}, {0, 1, 0}, 0.7, 2 * std::numbers::pi);
  EXPECT_EQ(whole.size(), 16u);
  EXPECT_EQ(On(whole, 15, 1).x, On(whole, 0, 0).x) << "closed to the bit";
}

TEST(Spans, AHelixWindsAround) {
  for (const double end_radius : {2.0, 0.0, 3.5}) {
    for (const double turns : {3.0, -1.25}) {
      const Helix helix{{0, 0, 1}, {0, 0, 9}, 2, end_radius, turns, {1, 0, 0}, {0, 1, 0}};
      Spans spans;
      helix.Make(spans);
      ExpectThatTheyMeet(spans);
      double worst = 0;
      for (size_t i = 0; i < spans.size(); ++i) {
        for (int k = 0; k <= 32; ++k) {
          const Vector p = On(spans, i, k / 32.0);
          // The position along the axis determines everything else: each place of the helix has a
          // height of its own.
          const double share = (p.z - 1) / 8, angle = 2 * std::numbers::pi * turns * share;
          const double radius = 2 + (end_radius - 2) * share;
          worst = std::max(
              worst, std::hypot(p.x - radius * std::cos(angle), p.y - radius * std::sin(angle)));
        }
      }
      EXPECT_LT(worst, 2e-4 * 3.5) << end_radius << " " << turns;
      EXPECT_NEAR(On(spans, 0, 0).z, 1, 1e-12);
      EXPECT_NEAR(On(spans, spans.size() - 1, 1).z, 9, 1e-9);
    }
  }
}

TEST(Spans, SplinesPassWhereTheySayAndAreSmooth) {
  const std::vector<Vector> points = {{0, 0, 0}, {1, 3, 0}, {4, 2, 1}, {5, -1, 2}, {7, 0, 0}};
  for (const bool closed : {false, true}) {
    for (const SplineForm form : {SplineForm::kCatmullRom, SplineForm::kBSpline}) {
      const Spline spline{points, form, closed};
      ASSERT_TRUE(spline.Fits());
      Spans spans;
      spline.Make(spans);
      ASSERT_EQ(spans.size(), closed ? 5u : 4u);
      ExpectThatTheyMeet(spans);
      for (size_t i = 0; i < spans.size(); ++i) {
        const Vector* p = &spans.points()[i * 4];
        const Vector* next = &spans.points()[(i + 1) % spans.size() * 4];
        if (form == SplineForm::kCatmullRom) {
          EXPECT_LT(implicit::Length(p[0] - points[i]), 1e-12) << "through its points";
        }
        if (i + 1 == spans.size() && !closed) continue;
        EXPECT_LT(implicit::Length((p[3] - p[2]) - (next[1] - next[0])), 1e-12) << "without a kink";
        if (form == SplineForm::kBSpline) {
          const Vector bend = p[3] - 2 * p[2] + p[1], after = next[2] - 2 * next[1] + next[0];
          EXPECT_LT(implicit::Length(bend - after), 1e-12) << "nor a change in curvature";
        }
      }
      if (!closed) {
        EXPECT_LT(implicit::Length(On(spans, 0, 0) - points.front()), 1e-12);
        EXPECT_LT(implicit::Length(On(spans, spans.size() - 1, 1) - points.back()), 1e-12);
      }
    }
  }
}

TEST(Spans, AQuadraticIsTheSameCurveAsACubicOne) {
  const Spline spline{{{0, 0, 0}, {2, 4, 0}, {4, 0, 0}}, SplineForm::kQuadratic, false};
  Spans spans;
  spline.Make(spans);
  for (const double t : {0.0, 0.25, 0.5, 1.0}) {
    EXPECT_NEAR(On(spans, 0, t).x, 4 * t, 1e-12);
    EXPECT_NEAR(On(spans, 0, t).y, 8 * t * (1 - t), 1e-12);
  }
}

TEST(Spans, HowManyPointsASplineTakes) {
  const auto fits = [](size_t n, SplineForm form, bool closed) {
    return Spline{std::vector<Vector>(n), form, closed}.Fits();
  };
  EXPECT_TRUE(fits(4, SplineForm::kBezier, false) && fits(7, SplineForm::kBezier, false));
  EXPECT_FALSE(fits(1, SplineForm::kBezier, false) || fits(5, SplineForm::kBezier, false));
  EXPECT_TRUE(fits(3, SplineForm::kBezier, true) && fits(6, SplineForm::kBezier, true));
  EXPECT_TRUE(fits(3, SplineForm::kQuadratic, false) && fits(2, SplineForm::kQuadratic, true));
  EXPECT_FALSE(fits(4, SplineForm::kQuadratic, false) || fits(3, SplineForm::kQuadratic, true));
  EXPECT_TRUE(fits(2, SplineForm::kCatmullRom, false) && fits(3, SplineForm::kCatmullRom, true));
  EXPECT_FALSE(fits(1, SplineForm::kBSpline, false) || fits(2, SplineForm::kBSpline, true));
}

}  // namespace
}  // namespace voxeld::gpu
