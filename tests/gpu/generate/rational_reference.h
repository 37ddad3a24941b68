// The generator's definition in rational numbers of any size, one voxel after the other: slow,
// plain, and independent of the tested code.
#pragma once

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <vector>

namespace voxeld::gpu::generate::testing {

using Integer = boost::multiprecision::cpp_int;
using Rational = boost::multiprecision::cpp_rational;
using Cell = std::array<int64_t, 3>;

inline Integer Floor(const Rational& r) {
  const Integer n = numerator(r), d = denominator(r);
  Integer q = n / d;
  if (q * d > n) --q;
  return q;
}

// Rounds to the nearest 1/65536, halves up.
inline Rational Snapped(double v) {
  return Rational(Floor(Rational(v) * 65536 + Rational(1, 2)), 65536);
}

struct ReferenceSegment {
  std::array<Rational, 3> s, e;
};

template <typename T>
ReferenceSegment ReferenceOf(const std::array<T, 3>& start, const std::array<T, 3>& end) {
  ReferenceSegment r;
  for (size_t a = 0; a < 3; ++a) {
    r.s[a] = Snapped(static_cast<double>(start[a]));
    r.e[a] = Snapped(static_cast<double>(end[a]));
  }
  return r;
}

inline Cell CellAt(const ReferenceSegment& g, const Integer& k, const Integer& n) {
  Cell cell;
  for (size_t a = 0; a < 3; ++a) {
    const Rational p = n == 0 ? g.s[a] : Rational(g.s[a] + (g.e[a] - g.s[a]) * Rational(k, n));
    cell[a] = static_cast<int64_t>(Floor(p));
  }
  return cell;
}

inline Integer EuclideanSteps(const ReferenceSegment& g) {
  Rational sum = 0;
  for (size_t a = 0; a < 3; ++a) sum += (g.e[a] - g.s[a]) * (g.e[a] - g.s[a]);
  // Returns the greatest n with n² ≤ sum.
  return sqrt(Floor(sum));
}

inline Integer ThinSteps(const ReferenceSegment& g) {
  Integer most = 0;
  for (size_t a = 0; a < 3; ++a) {
    const Integer d = abs(Integer(Floor(g.e[a]) - Floor(g.s[a])));
    most = std::max(most, d);
  }
  return most;
}

inline std::vector<Cell> Steps(const ReferenceSegment& g, const Integer& n) {
  std::vector<Cell> cells;
  for (Integer k = 0; k <= n; ++k) cells.push_back(CellAt(g, k, n));
  if (n == 0) {
    const Cell end = CellAt({g.e, g.e}, 0, 0);
    if (end != cells[0]) cells.push_back(end);
  }
  return cells;
}

// Returns every crossing of a face, sorted.
inline std::vector<Cell> Crossed(ReferenceSegment g) {
  if (std::lexicographical_compare(g.e.begin(), g.e.end(), g.s.begin(), g.s.end()))
    std::swap(g.s, g.e);
  struct Crossing {
    Rational t;
    size_t axis;
    int64_t direction;
  };
  std::vector<Crossing> crossings;
  for (size_t a = 0; a < 3; ++a) {
    const Rational d = g.e[a] - g.s[a];
    Integer cell = Floor(g.s[a]);
    const Integer last = Floor(g.e[a]);
    while (cell < last) crossings.push_back({(Rational(++cell) - g.s[a]) / d, a, 1});
    while (cell > last) crossings.push_back({(Rational(cell--) - g.s[a]) / d, a, -1});
  }
  std::stable_sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return std::tie(a.t, a.axis) < std::tie(b.t, b.axis);
  });
  std::vector<Cell> cells = {CellAt({g.s, g.s}, 0, 0)};
  for (const Crossing& c : crossings) {
    cells.push_back(cells.back());
    cells.back()[c.axis] += c.direction;
  }
  return cells;
}

}  // namespace voxeld::gpu::generate::testing
