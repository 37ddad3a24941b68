// Tests smooth boundaries as lines: how far these are from the curves, which are computed here by
// their own formulas.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <variant>
#include <vector>

#include "daemon/wire/boundary.h"
#include "daemon/wire/primitive.h"
#include "tests/daemon/wire/faults.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace boundary_test {

using ::testing::HasSubstr;

using P = v1::Primitive;
using Point = std::array<double, 2>;

constexpr int kSamples = 400;  // in each span

MaybeFault FaultOf(const P& primitive, Content* content, const Limits& limits = {}) {
  return ToContent(FieldPath("primitive"), primitive, {limits}, content);
}

// Returns the plane within curves through the vertices: `outline` across the axis, at heights that
// do not lie in one plane.
P Bounded(const std::vector<Point>& outline, v1::Boundary::Form form, v1::Boundary::Axis axis) {
  P p;
  p.mutable_implicit()->mutable_surface()->set_text("z = 0");
  v1::Boundary* const boundary = p.mutable_implicit()->mutable_boundary();
  boundary->set_form(form);
  boundary->set_axis(axis);
  for (size_t i = 0; i < outline.size(); ++i) {
    const double height = 100.0 * static_cast<double>(i % 3);
    const auto add = [&](double x, double y, double z) {
      for (const double number : {x, y, z}) boundary->add_points(number);
    };
    if (axis == v1::Boundary::X) {
      add(height, outline[i][0], outline[i][1]);
    } else {
      add(outline[i][0], outline[i][1], height);
    }
  }
  return p;
}

// Returns the ends of the lines, across the axis.
std::vector<Point> LinesOf(const P& primitive, const Limits& limits = {}) {
  Content content;
  const MaybeFault fault = FaultOf(primitive, &content, limits);
  EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
  const auto positions = std::get<GeometryPtr>(content)->arrays.positions();
  const size_t first = primitive.implicit().boundary().axis() == v1::Boundary::X ? 1 : 0;
  std::vector<Point> lines;
  for (size_t i = 0; i + 2 < positions.size(); i += 3) {
    lines.push_back({double{positions[i + first]}, double{positions[i + first + 1]}});
  }
  return lines;
}

double CatmullRom(double a, double b, double c, double d, double t) {
  return 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t +
                (3 * b - a - 3 * c + d) * t * t * t);
}
double BSpline(double a, double b, double c, double d, double t) {
  const double s = 1 - t;
  return (s * s * s * a + (3 * t * t * t - 6 * t * t + 4) * b +
          (3 * s * s * s - 6 * s * s + 4) * c + t * t * t * d) /
         6;
}

std::vector<Point> CurveOf(const std::vector<Point>& p,
                           double (*basis)(double, double, double, double, double)) {
  std::vector<Point> all;
  const size_t n = p.size();
  for (size_t i = 0; i < n; ++i) {
    for (int k = 0; k < kSamples; ++k) {
      Point at;
      for (size_t a = 0; a < 2; ++a) {
        at[a] = basis(p[(i + n - 1) % n][a], p[i][a], p[(i + 1) % n][a], p[(i + 2) % n][a],
                      static_cast<double>(k) / kSamples);
      }
      all.push_back(at);
    }
  }
  return all;
}

double Distance(const Point& p, const Point& a, const Point& b) {
  const double x = b[0] - a[0], y = b[1] - a[1], square = x * x + y * y;
  const double t =
      square > 0 ? std::clamp(((p[0] - a[0]) * x + (p[1] - a[1]) * y) / square, 0.0, 1.0) : 0;
  return std::hypot(a[0] + t * x - p[0], a[1] + t * y - p[1]);
}

// Returns the greatest distance of any of `points` from closed lines.
double Farthest(const std::vector<Point>& points, const std::vector<Point>& lines) {
  double farthest = 0;
  for (const Point& p : points) {
    double nearest = 1e300;
    for (size_t i = 0; i < lines.size(); ++i) {
      nearest = std::min(nearest, Distance(p, lines[i], lines[(i + 1) % lines.size()]));
    }
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

const std::vector<Point> kOutline = {{-3, -1}, {0, -2.5}, {4, -1}, {1, 0.5}, {3, 5}, {-2, 3}};
constexpr double kExtent = 7.5;  // from -2.5 to 5; across it is 7

struct FormCase {
  v1::Boundary::Form form;
  double (*basis)(double, double, double, double, double);
};

TEST(Boundaries, SmoothOnesAreCutWithinTheirError) {
  for (const FormCase& c : {FormCase{v1::Boundary::CATMULL_ROM, CatmullRom},
                            FormCase{v1::Boundary::B_SPLINE, BSpline}}) {
    const std::vector<Point> curve = CurveOf(kOutline, c.basis);
    for (const v1::Boundary::Axis axis : {v1::Boundary::Z, v1::Boundary::X}) {
      const std::vector<Point> lines = LinesOf(Bounded(kOutline, c.form, axis));
      EXPECT_LT(Farthest(curve, lines), kBoundaryError * kExtent);
      EXPECT_GT(Farthest(kOutline, lines) + Farthest(curve, kOutline), 0.1) << "not a polygon";
      EXPECT_LT(lines.size(), 200u) << "and only as many as necessary";
      for (const Point& end : lines) EXPECT_LT(Farthest({end}, curve), 1e-4) << "they end on it";
    }
  }
}

TEST(Boundaries, PolylinesStayAsTheyAre) {
  const std::vector<Point> lines =
      LinesOf(Bounded(kOutline, v1::Boundary::FORM_UNSPECIFIED, v1::Boundary::Z));
  EXPECT_EQ(lines, kOutline);
  EXPECT_EQ(LinesOf(Bounded(kOutline, v1::Boundary::POLYLINE, v1::Boundary::Z)), kOutline);
}

TEST(Boundaries, EachCurveClosesOnItself) {
  // Two outlines far apart: no line leads from one to the other.
  std::vector<Point> both = kOutline;
  for (const Point& p : kOutline) both.push_back({p[0] + 1000, p[1]});
  P two = Bounded(both, v1::Boundary::CATMULL_ROM, v1::Boundary::Z);
  two.mutable_implicit()->mutable_boundary()->add_ends(6);
  two.mutable_implicit()->mutable_boundary()->add_ends(12);
  const std::vector<Point> lines = LinesOf(two);
  for (size_t i = 0; i < lines.size(); ++i) {
    EXPECT_TRUE(std::fabs(lines[i][0]) < 10 || std::fabs(lines[i][0] - 1000) < 10);
  }
  const auto second =
      std::find_if(lines.begin(), lines.end(), [](const Point& p) { return p[0] > 500; });
  EXPECT_NEAR((*second)[0], 997, 1e-6) << "which begins with its first vertex";
  EXPECT_NEAR((*second)[1], -1, 1e-6);
}

TEST(Boundaries, OfNoExtentAreLinesOfNoLength) {
  const std::vector<Point> nowhere(4, Point{2, 3});
  EXPECT_EQ(LinesOf(Bounded(nowhere, v1::Boundary::B_SPLINE, v1::Boundary::Z)).size(), 4u);
}

TEST(Boundaries, LimitsHoldForTheLines) {
  const P smooth = Bounded(kOutline, v1::Boundary::CATMULL_ROM, v1::Boundary::Z);
  const auto lines = static_cast<uint32_t>(LinesOf(smooth).size());
  EXPECT_EQ(LinesOf(smooth, {.max_boundary_points = lines}).size(), lines);
  Content content;
  const MaybeFault fault = FaultOf(smooth, &content, {.max_boundary_points = lines - 1});
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_EQ(fault->field, "primitive.implicit.boundary.points");
  EXPECT_THAT(fault->message, HasSubstr("more lines than max_boundary_points allows"));
}

TEST(Boundaries, OvershootingAllNumbersIsRefused) {
  const std::vector<Point> vast = {{-3e38, -3e38}, {3e38, -3e38}, {3e38, 3e38}, {-3e38, 3e38}};
  Content content;
  const MaybeFault fault =
      FaultOf(Bounded(vast, v1::Boundary::CATMULL_ROM, v1::Boundary::Z), &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kOutOfRange);
  EXPECT_THAT(fault->message, HasSubstr("beyond what single precision holds"));
}

P Smooth() { return Bounded(kOutline, v1::Boundary::CATMULL_ROM, v1::Boundary::Z); }

TEST(Boundaries, WhatIsWrongIsSaid) {
  const FaultCase cases[] = {
      {"form", Smooth,
       [](P& p) {
         p.mutable_implicit()->mutable_boundary()->set_form(static_cast<v1::Boundary::Form>(9));
       },
       "primitive.implicit.boundary.form", Reason::kInvalidValue, "CATMULL_ROM"},
      {"two vertices", Smooth,
       [](P& p) { p.mutable_implicit()->mutable_boundary()->mutable_points()->Truncate(6); },
       "primitive.implicit.boundary.ends[0]", Reason::kIndexOutOfRange, "a curve has 3 at least"},
      {"infinite", Smooth,
       [](P& p) { p.mutable_implicit()->mutable_boundary()->set_points(4, HUGE_VAL); },
       "primitive.implicit.boundary.points[4]", Reason::kInvalidValue, ""},
  };
  ExpectFaults(cases, [](const P& p, Content* content) { return FaultOf(p, content); });
}

}  // namespace boundary_test
}  // namespace voxeld::daemon::wire
