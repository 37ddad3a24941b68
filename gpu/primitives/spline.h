// Smooth curves along points, as cubic Béziers: through all points (Catmull–Rom, whose tangents are
// half the vector between neighbours), or near them (uniform cubic B-splines), and Béziers
// themselves. An open curve is extended in a straight line, so it begins and ends in the outermost
// points.
//
// Guarantee: a curve begins and ends in its outermost points. Catmull–Rom goes through all its
// points; Catmull–Rom and B-splines are smooth.
#pragma once

#include <cstdint>
#include <vector>

#include "gpu/curves/spans.h"

namespace voxeld::gpu {

enum class SplineForm : uint8_t { kCatmullRom, kBSpline, kBezier, kQuadratic };

struct Spline {
  std::vector<implicit::Vector> points;
  SplineForm form = SplineForm::kCatmullRom;
  bool closed = false;

  // Returns whether the number of points is valid for the form.
  bool Fits() const {
    const size_t n = points.size();
    switch (form) {
      case SplineForm::kBezier:
        return closed ? n >= 3 && n % 3 == 0 : n >= 4 && n % 3 == 1;
      case SplineForm::kQuadratic:
        return closed ? n >= 2 && n % 2 == 0 : n >= 3 && n % 2 == 1;
      default:
        return n >= (closed ? 3u : 2u);
    }
  }

  // Calls each(from, to) for every span: the points at its ends or, for a B-spline, the points
  // nearest to its ends.
  template <typename Each>
  void ForEachJoint(Each&& each) const {
    const size_t step = form == SplineForm::kBezier ? 3 : form == SplineForm::kQuadratic ? 2 : 1;
    const size_t n = points.size(), count = closed ? n / step : (n - 1) / step;
    for (size_t i = 0; i < count; ++i) each(i * step, (i + 1) * step % n);
  }

  // Adds the spans in the order of ForEachJoint. Requires: Fits().
  void Make(Spans& spans) const {
    using implicit::Vector;
    ForEachJoint([&](size_t from, size_t to) {
      switch (form) {
        case SplineForm::kBezier:
          return spans.Curve(points[from], points[from + 1], points[from + 2], points[to]);
        case SplineForm::kQuadratic:
          return spans.Quadratic(points[from], points[from + 1], points[to]);
        default:
          break;
      }
      const Vector a = At(from, -1), b = points[from], c = points[to], d = At(to, +1);
      if (form == SplineForm::kCatmullRom) {
        return spans.Curve(b, b + (1.0 / 6) * (c - a), c - (1.0 / 6) * (d - b), c);
      }
      spans.Curve((1.0 / 6) * (a + 4 * b + c), (1.0 / 3) * (2 * b + c), (1.0 / 3) * (b + 2 * c),
                  (1.0 / 6) * (b + 4 * c + d));
    });
  }

 private:
  // Returns the point before or after one; past an open end it is reflected.
  implicit::Vector At(size_t i, int step) const {
    const size_t n = points.size();
    if (closed) return points[(i + (step < 0 ? n - 1 : 1)) % n];
    if (step < 0) return i > 0 ? points[i - 1] : 2 * points[0] - points[1];
    return i + 1 < n ? points[i + 1] : 2 * points[n - 1] - points[n - 2];
  }
};

}  // namespace voxeld::gpu
