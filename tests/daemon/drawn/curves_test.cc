// Compares curves of every kind with closely spaced places on them, computed in double precision
// from their messages: a thick curve consists of everything within its radius, at its joints as
// elsewhere; a curve one voxel wide has no gaps.
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "gpu/curves/cut.h"
#include "tests/daemon/drawn/drawn.h"

namespace voxeld::daemon::drawn {
namespace {

constexpr int32_t kSize = 64;
constexpr double kScale = 5;  // voxels a unit
constexpr int kPlaces = 20'000;
constexpr double kApart = 0.05;  // voxels between two places, at most
constexpr double kTurn = 2 * std::numbers::pi;

struct Case {
  std::string name;
  P primitive;
  std::function<Vector(double)> at;  // 0 to 1
  double error = gpu::kCurveError;
};

// For uniform knots 0, 1, 2, …: the cubic basis spline over [k, k + 4], by Cox and de Boor's
// recursion.
double Basis(int k, int degree, double t) {
  if (degree == 0) return t >= k && t < k + 1 ? 1 : 0;
  return (t - k) / degree * Basis(k, degree - 1, t) +
         (k + degree + 1 - t) / degree * Basis(k + 1, degree - 1, t);
}

double Choose(int n, int i) { return i == 0 ? 1 : Choose(n, i - 1) * (n - i + 1) / i; }

// Evaluated with Bernstein polynomials.
Vector BezierAt(const std::vector<Vector>& points, int degree, double t) {
  const size_t spans = points.size() / static_cast<size_t>(degree);
  const double along = t * static_cast<double>(spans);
  const auto span = std::min(spans - 1, static_cast<size_t>(along));
  const double s = along - static_cast<double>(span);
  Vector sum;
  for (int i = 0; i <= degree; ++i) {
    const double weight = Choose(degree, i) * std::pow(s, i) * std::pow(1 - s, degree - i);
    sum = sum +
          weight *
              points[(span * static_cast<size_t>(degree) + static_cast<size_t>(i)) % points.size()];
  }
  return sum;
}

// The point before the first and the one after the last of an open curve continue in a straight
// line.
Vector PointAt(const std::vector<Vector>& points, bool closed, int i) {
  const int n = static_cast<int>(points.size());
  const auto at = [&](int k) { return points[static_cast<size_t>(k)]; };
  if (closed) return at((i + n) % n);
  if (i < 0) return 2 * at(0) - at(1);
  return i < n ? at(i) : 2 * at(n - 1) - at(n - 2);
}

// Through b at t = 0 and c at t = 1, with half of c − a and half of d − b as slopes there.
Vector HermiteAt(const Vector& a, const Vector& b, const Vector& c, const Vector& d, double t) {
  const double t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * b + (t3 - 2 * t2 + t) * (0.5 * (c - a)) + (3 * t2 - 2 * t3) * c +
         (t3 - t2) * (0.5 * (d - b));
}

Vector SplineAt(const std::vector<Vector>& points, v1::Curve::Form form, bool closed, double t) {
  if (form == v1::Curve::BEZIER) return BezierAt(points, 3, t);
  if (form == v1::Curve::QUADRATIC) return BezierAt(points, 2, t);
  const int spans = static_cast<int>(points.size()) - (closed ? 0 : 1);
  const int span = std::min(spans - 1, static_cast<int>(t * spans));
  const double s = t * spans - span;
  const auto point = [&](int i) { return PointAt(points, closed, span + i); };
  if (form == v1::Curve::CATMULL_ROM) return HermiteAt(point(-1), point(0), point(1), point(2), s);
  Vector sum;
  for (int i = 0; i < 4; ++i) sum = sum + Basis(i, 3, 3 + std::min(s, 1 - 1e-12)) * point(i - 1);
  return sum;
}

Case Curve(std::string name, v1::Curve::Form form, bool closed, const std::vector<Vector>& points) {
  Case c{std::move(name), {}, [=](double t) { return SplineAt(points, form, closed, t); }};
  c.primitive.mutable_curve()->set_form(form);
  c.primitive.mutable_curve()->set_closed(closed);
  Set(c.primitive.mutable_curve()->mutable_vertices(), points);
  return c;
}

Case Polyline(const std::vector<Vector>& points, bool loop) {
  Case c{loop ? "loop" : "strip", {}, [=](double t) {
           const size_t n = points.size(), spans = loop ? n : n - 1;
           const double along = t * static_cast<double>(spans);
           const size_t span = std::min(spans - 1, static_cast<size_t>(along));
           return points[span] +
                  (along - static_cast<double>(span)) * (points[(span + 1) % n] - points[span]);
         }};
  c.primitive.mutable_segments()->set_topology(loop ? v1::Segments::LOOP : v1::Segments::STRIP);
  Set(c.primitive.mutable_segments()->mutable_vertices(), points);
  c.error = 0;
  return c;
}

// Returns the two directions across `axis`: the one towards `toward`, and the one a quarter turn
// further, as seen from where the axis points to.
std::array<Vector, 2> Frame(const Vector& axis, const Vector& toward) {
  const Vector w = Unit(axis);
  const Vector u = Unit(toward - gpu::implicit::Dot(toward, w) * w);
  return {u, gpu::implicit::Cross(w, u)};
}

Case Arc(std::string name, const Vector& normal, const Vector& toward, double start, double sweep) {
  const Vector center = {0.2, 0.1, -0.3};
  const auto [u, v] = Frame(normal, toward);
  const double all = sweep == 0 ? kTurn : sweep;
  Case c{std::move(name), {}, [=, u = u, v = v](double t) {
           const double angle = start + t * all;
           return center + 4.5 * std::cos(angle) * u + 4.5 * std::sin(angle) * v;
         }};
  v1::Arc* const arc = c.primitive.mutable_arc();
  Set(arc->mutable_center(), center);
  Set(arc->mutable_normal(), normal);
  Set(arc->mutable_toward(), toward);
  arc->set_radius(4.5);
  arc->set_start(start);
  arc->set_sweep(sweep);
  return c;
}

Case Ellipse(std::string name, double start, double sweep) {
  const Vector a = {4.6, 0.5, 1}, b = {-0.4, 1.5, 0.6};  // not orthogonal
  const double all = sweep == 0 ? kTurn : sweep;
  Case c{std::move(name), {}, [=](double t) {
           return std::cos(start + t * all) * a + std::sin(start + t * all) * b;
         }};
  Set(c.primitive.mutable_ellipse()->mutable_axis_a(), a);
  Set(c.primitive.mutable_ellipse()->mutable_axis_b(), b);
  c.primitive.mutable_ellipse()->set_start(start);
  c.primitive.mutable_ellipse()->set_sweep(sweep);
  return c;
}

Case Helix(std::string name, double end_radius, double turns) {
  const Vector start = {-1, -1.5, -4}, end = {1, 1.5, 4}, toward = {0, 1, 1};
  const auto [u, v] = Frame(end - start, toward);
  Case c{std::move(name), {}, [=, u = u, v = v](double t) {
           const double radius = 2.5 + t * (end_radius - 2.5), angle = kTurn * turns * t;
           return start + t * (end - start) + radius * std::cos(angle) * u +
                  radius * std::sin(angle) * v;
         }};
  v1::Helix* const helix = c.primitive.mutable_helix();
  Set(helix->mutable_start(), start);
  Set(helix->mutable_end(), end);
  Set(helix->mutable_toward(), toward);
  helix->set_radius(2.5);
  helix->set_end_radius(end_radius);
  helix->set_turns(turns);
  return c;
}

std::vector<Case> Cases() {
  // Corners, among them sharp ones.
  const std::vector<Vector> six = {{-4, -3, -2}, {-2, 4, 0}, {0.5, -4, 1},
                                   {1, 3.5, 2},  {4, 3, -1}, {4, -3, -3}};
  std::vector<Vector> seven = six;
  seven.push_back({-1, -4.5, -4});
  const std::vector<Vector> five(seven.begin(), seven.begin() + 5);
  std::vector<Case> cases;
  using C = v1::Curve;
  cases.push_back(Curve("Catmull-Rom", C::CATMULL_ROM, false, six));
  cases.push_back(Curve("Catmull-Rom of two", C::CATMULL_ROM, false, {six[0], six[3]}));
  cases.push_back(Curve("Catmull-Rom, closed", C::CATMULL_ROM, true, five));
  cases.push_back(Curve("B-spline", C::B_SPLINE, false, six));
  cases.push_back(Curve("B-spline, closed", C::B_SPLINE, true, five));
  cases.push_back(Curve("Béziers", C::BEZIER, false, seven));
  cases.push_back(Curve("Béziers, closed", C::BEZIER, true, six));
  cases.push_back(Curve("quadratic", C::QUADRATIC, false, seven));
  cases.push_back(Curve("quadratic, closed", C::QUADRATIC, true, six));
  cases.push_back(Arc("circle", {1, 2, 2}, {1, 0, 0}, 0, 0));
  cases.push_back(Arc("arc", {1, -2, 0.5}, {0, 1, 1}, 0.7, 4.1));
  cases.push_back(Arc("arc backwards", {-1, 0, 3}, {2, 1, 0}, -1, -2));
  cases.push_back(Ellipse("ellipse", 0, 0));
  cases.push_back(Ellipse("part of an ellipse", 0.4, -3.5));
  cases.push_back(Helix("helix", 2.5, 3));
  cases.push_back(Helix("left-handed helix to a point", 0, -2.5));
  cases.push_back(Polyline(six, false));
  cases.push_back(Polyline(five, true));
  return cases;
}

void SetLook(P& p, v1::LineSampling sampling, float thickness) {
  const auto set = [&](auto* message) {
    message->set_sampling(sampling);
    message->mutable_thickness()->set_value(thickness);
  };
  if (p.has_curve()) set(p.mutable_curve());
  if (p.has_arc()) set(p.mutable_arc());
  if (p.has_ellipse()) set(p.mutable_ellipse());
  if (p.has_helix()) set(p.mutable_helix());
  if (p.has_segments()) set(p.mutable_segments());
}

class DrawnCurves : public DrawnPrimitives {
 protected:
  DrawnCurves() : DrawnPrimitives(kSize) {}

  std::vector<Vector> Places(const Case& c) const {
    std::vector<Vector> places;
    for (int i = 0; i <= kPlaces; ++i) {
      places.push_back(placed_.Forth(c.at(static_cast<double>(i) / kPlaces)));
      if (i == 0) continue;
      EXPECT_LT(gpu::implicit::Length(places.back() - places[places.size() - 2]), kApart);
    }
    return places;
  }

  const Placement placed_ = Placed(0.9, kScale, kSize / 2, 0.3);
};

TEST_F(DrawnCurves, ThickOnesAreWhatIsWithinTheirRadius) {
  for (Case& c : Cases()) {
    SCOPED_TRACE(c.name);
    const std::vector<Vector> places = Places(c);
    for (const double radius : {0.4, 1.65, 3.2}) {
      // The voxels of their lines are lit as well.
      const double most = std::max(radius, kHalfDiagonal) + c.error + kSnapped;
      Distances distances(kSize, most + 0.1);
      for (const Vector& place : places) distances.Add(place);
      SetLook(c.primitive, v1::LINE_SAMPLING_THIN, static_cast<float>(2 * radius));
      const Drawn drawn = Draw(c.primitive, placed_.map);
      uint64_t lit = 0, far = 0, missing = 0;
      drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
        const double d = distances.At(x, y, z);
        lit += drawn.Lit(x, y, z);
        far += drawn.Lit(x, y, z) && d > most + kApart * kApart;
        missing += !drawn.Lit(x, y, z) && d < radius - c.error - kSnapped;
      });
      EXPECT_EQ(far, 0u) << radius;
      EXPECT_EQ(missing, 0u) << radius;
      EXPECT_GT(lit, 20u);
    }
  }
}

TEST_F(DrawnCurves, OfOneVoxelsWidthHaveNoGaps) {
  for (Case& c : Cases()) {
    const std::vector<Vector> places = Places(c);
    for (const auto sampling :
         {v1::LINE_SAMPLING_THIN, v1::LINE_SAMPLING_EUCLIDEAN, v1::LINE_SAMPLING_COVER}) {
      SCOPED_TRACE(c.name + ", sampling " + std::to_string(sampling));
      SetLook(c.primitive, sampling, 0);
      const Drawn drawn = Draw(c.primitive, placed_.map);
      const double most = kHalfDiagonal + c.error + kSnapped;
      Distances distances(kSize, most + 0.1);
      std::array<int32_t, 3> first = {};
      for (const Vector& place : places) {
        distances.Add(place);
        // The cells of a cover touch it up to the error; others are at most a step aside.
        const bool cover = sampling == v1::LINE_SAMPLING_COVER;
        const int32_t v[3] = {static_cast<int32_t>(std::floor(place.x)),
                              static_cast<int32_t>(std::floor(place.y)),
                              static_cast<int32_t>(std::floor(place.z))};
        bool near = drawn.Lit(v[0], v[1], v[2]);
        if (near) first = {v[0], v[1], v[2]};
        drawn.ForEachNeighbour(v[0], v[1], v[2], true, [&](int32_t x, int32_t y, int32_t z) {
          const double beside =
              std::max({std::fabs(x + 0.5 - place.x), std::fabs(y + 0.5 - place.y),
                        std::fabs(z + 0.5 - place.z)});
          near |= drawn.Lit(x, y, z) && (!cover || beside <= 0.5 + c.error + kSnapped);
        });
        ASSERT_TRUE(near) << place.x << " " << place.y << " " << place.z;
      }
      const std::vector<uint8_t> reached =
          drawn.Reached(first, true, sampling != v1::LINE_SAMPLING_COVER);
      // EUCLIDEAN steps may pass over a corner: for those nothing is guaranteed.
      uint64_t far = 0, apart = 0;
      drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
        if (!drawn.Lit(x, y, z)) return;
        far += distances.At(x, y, z) > most + kApart * kApart;
        apart += reached[drawn.Index(x, y, z)] == 0 && sampling != v1::LINE_SAMPLING_EUCLIDEAN;
      });
      EXPECT_EQ(far, 0u);
      EXPECT_EQ(apart, 0u);
    }
  }
}

}  // namespace
}  // namespace voxeld::daemon::drawn
