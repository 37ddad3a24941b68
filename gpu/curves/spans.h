// Builds cubic Béziers from straight lines, arcs and handles: a list of 4 points each, in the
// format of kCurves.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

class Spans {
 public:
  using Vector = implicit::Vector;

  const std::vector<Vector>& points() const { return points_; }  // 4 a span
  size_t size() const { return points_.size() / 4; }

  void Curve(const Vector& a, const Vector& b, const Vector& c, const Vector& d) {
    points_.insert(points_.end(), {a, b, c, d});
  }
  void Line(const Vector& a, const Vector& b) {
    Curve(a, a + (1.0 / 3) * (b - a), b - (1.0 / 3) * (b - a), b);
  }
  // Adds a quadratic curve, which a cubic one represents exactly.
  void Quadratic(const Vector& a, const Vector& b, const Vector& c) {
    Curve(a, a + (2.0 / 3) * (b - a), c + (2.0 / 3) * (b - c), c);
  }
  // Adds the arc center + cos t·a + sin t·b, plus `rise` per radian, from `start` on, through
  // `sweep` radians. The error of an arc of radius r is at most 7e-8·r; if it rises, the place
  // along `rise` has that error.
  void Arc(const Vector& center, const Vector& a, const Vector& b, double start, double sweep,
           const Vector& rise = {}) {
    Spiral(center, a, b, start, sweep, rise, 0);
  }
  // The same, while a and b grow by the factor `growth` per radian.
  void Spiral(const Vector& center, const Vector& a, const Vector& b, double start, double sweep,
              const Vector& rise, double growth) {
    const double turns = std::fabs(sweep) / (2 * std::numbers::pi);
    const auto count =
        std::max<size_t>(1, static_cast<size_t>(std::ceil(turns * kSpansPerTurn - 1e-9)));
    const double step = sweep / static_cast<double>(count);
    const double handle = 4.0 / 3 * std::tan(step / 4);
    const auto at = [&](double t) {
      const double grown = 1 + growth * (t - start);
      return center + (grown * std::cos(t)) * a + (grown * std::sin(t)) * b + (t - start) * rise;
    };
    const auto slope = [&](double t) {
      const double grown = 1 + growth * (t - start);
      return (growth * std::cos(t) - grown * std::sin(t)) * a +
             (growth * std::sin(t) + grown * std::cos(t)) * b + rise;
    };
    const bool whole = growth == 0 && implicit::Length(rise) == 0 &&
                       std::fabs(std::fabs(sweep) - 2 * std::numbers::pi) < 1e-12;
    for (size_t i = 0; i < count; ++i) {
      const double from = start + step * static_cast<double>(i);
      const double to = i + 1 == count ? start + sweep : start + step * static_cast<double>(i + 1);
      const Vector end = whole && i + 1 == count ? at(start) : at(to);
      Curve(at(from), at(from) + handle * slope(from), end - handle * slope(to), end);
    }
  }

  void Add(const Spans& other) {
    points_.insert(points_.end(), other.points_.begin(), other.points_.end());
  }

  static constexpr double kSpansPerTurn = 16;

 private:
  std::vector<Vector> points_;
};

// Returns into how many equal parts a span of 4 points is cut so that their distance from it is at
// most `error`: max|B″|/(8n²), where |B″| is at most 6 times the greater of the points' second
// differences. A whole number, at least 1.
inline double PartsOfSpan(const implicit::Vector* p, double error) {
  const double bend =
      std::max(implicit::Length(p[0] - 2 * p[1] + p[2]), implicit::Length(p[1] - 2 * p[2] + p[3]));
  return std::max(1.0, std::ceil(std::sqrt(0.75 * bend / error)));
}

// Returns the point of a span at `t`, 0 to 1 from its first point to its last.
inline implicit::Vector OnSpan(const implicit::Vector* p, double t) {
  const double s = 1 - t;
  return s * s * s * p[0] + 3 * s * s * t * p[1] + 3 * s * t * t * p[2] + t * t * t * p[3];
}

// Computes two unit vectors across `axis` and perpendicular to each other: the first on the side of
// `toward`, as far as that lies across; the second a quarter turn on, counter-clockwise as seen
// from where the axis points to. Returns false if no such vectors exist.
inline bool FrameOf(const implicit::Vector& axis, const implicit::Vector& toward,
                    implicit::Vector* u, implicit::Vector* v) {
  const double length = implicit::Length(axis);
  if (!(length > 0)) return false;
  const implicit::Vector unit = 1 / length * axis;
  const implicit::Vector across = toward - implicit::Dot(toward, unit) * unit;
  const double reach = implicit::Length(across);
  if (!(reach > 1e-9 * implicit::Length(toward))) return false;
  *u = 1 / reach * across;
  *v = implicit::Cross(unit, *u);
  return true;
}

}  // namespace voxeld::gpu
