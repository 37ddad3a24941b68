// Interval arithmetic that contains the results of single precision.
//
// An interval contains every value that the functions of number.h may return for arguments within
// the given intervals: if `nan` is false all lie in [lo, hi]; if it is true some may also be NaN.
// The four operations, squares, roots and floors are correctly rounded, so they are monotonic where
// the exact ones are, and their values at the ends bound those within without widening. Results of
// polynomials are widened by more than twice their error, kSlack. Where an exact function would be
// undefined or unbounded, the result is everything.
//
// Ends may be infinite, and are never NaN.
#pragma once

#include "gpu/implicit/number.h"

// Marks the long operations. A source whose kernels need them only where speed does not matter
// defines VOXELD_INTERVALS_OUT_OF_LINE: nvcc then compiles each of them once, and not at every call
// in an expression.
#if defined(VOXELD_INTERVALS_OUT_OF_LINE)
#define VOXELD_INTERVAL VOXELD_HD VOXELD_DEVICE_NOINLINE inline Interval
#else
#define VOXELD_INTERVAL VOXELD_HD inline Interval
#endif

namespace voxeld::gpu::implicit {

struct Interval {
  float lo = 0, hi = 0;
  bool nan = false;

  VOXELD_HD static Interval Everything() { return {-Infinity(), Infinity(), true}; }
  VOXELD_HD bool Has(float x) const { return IsNan(x) ? nan : lo <= x && x <= hi; }
};

// More than four times the error of a polynomial in number.h.
inline constexpr float kSlack = 1.9073486328125e-06f;  // 2⁻¹⁹

VOXELD_HD inline Interval ConstantLike(const Interval&, float value) {
  return IsNan(value) ? Interval::Everything() : Interval{value, value, false};
}

VOXELD_HD inline Interval Hull(const Interval& a, const Interval& b) {
  return {a.lo < b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi, a.nan || b.nan};
}

// Makes an interval of computed ends: everything if one of them is NaN.
VOXELD_HD inline Interval Checked(float lo, float hi, bool nan) {
  return IsNan(lo) || IsNan(hi) ? Interval::Everything() : Interval{lo, hi, nan};
}
// Sums of infinities of both signs may have numbers as ends although values in between are NaN.
VOXELD_HD inline bool Bounded(const Interval& a) { return IsFinite(a.lo) && IsFinite(a.hi); }

VOXELD_HD inline Interval Add(const Interval& a, const Interval& b) {
  const bool undefined = !Bounded(a) && !Bounded(b);
  return Checked(a.lo + b.lo, a.hi + b.hi, a.nan || b.nan || undefined);
}
VOXELD_HD inline Interval Sub(const Interval& a, const Interval& b) {
  const bool undefined = !Bounded(a) && !Bounded(b);
  return Checked(a.lo - b.hi, a.hi - b.lo, a.nan || b.nan || undefined);
}
VOXELD_HD inline Interval Neg(const Interval& a) { return {-a.hi, -a.lo, a.nan}; }

// Returns the hull of four corners; everything if one of them is NaN.
VOXELD_HD inline Interval OfCorners(float a, float b, float c, float d, bool nan) {
  if (IsNan(a) || IsNan(b) || IsNan(c) || IsNan(d)) return Interval::Everything();
  const float lo1 = a < b ? a : b, hi1 = a < b ? b : a;
  const float lo2 = c < d ? c : d, hi2 = c < d ? d : c;
  return {lo1 < lo2 ? lo1 : lo2, hi1 > hi2 ? hi1 : hi2, nan};
}
VOXELD_HD inline bool HasZero(const Interval& a) { return a.lo <= 0 && a.hi >= 0; }

VOXELD_INTERVAL Mul(const Interval& a, const Interval& b) {
  // Zero times infinity is undefined.
  const bool undefined = (HasZero(a) && !Bounded(b)) || (HasZero(b) && !Bounded(a));
  if (undefined) return Interval::Everything();
  return OfCorners(a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi, a.nan || b.nan);
}
VOXELD_INTERVAL Div(const Interval& a, const Interval& b) {
  if (HasZero(b) || (!Bounded(a) && !Bounded(b))) return Interval::Everything();
  return OfCorners(a.lo / b.lo, a.lo / b.hi, a.hi / b.lo, a.hi / b.hi, a.nan || b.nan);
}

VOXELD_HD inline Interval Abs(const Interval& a) {
  if (a.lo >= 0) return a;
  if (a.hi <= 0) return Neg(a);
  return {0, -a.lo > a.hi ? -a.lo : a.hi, a.nan};
}
VOXELD_HD inline Interval Square(const Interval& a) {
  const Interval b = Abs(a);
  return {b.lo * b.lo, b.hi * b.hi, a.nan};
}
VOXELD_HD inline Interval Sqrt(const Interval& a) {
  const float lo = a.lo > 0 ? a.lo : 0, hi = a.hi > 0 ? a.hi : 0;
  return {Sqrt(lo), Sqrt(hi), a.nan || a.lo < 0};
}
VOXELD_HD inline Interval Floor(const Interval& a) { return {Floor(a.lo), Floor(a.hi), a.nan}; }

// Move a bound down or up in proportion, by kSlack.
VOXELD_HD inline float Below(float x) { return x - (Abs(x) * kSlack + 1.0e-44f); }
VOXELD_HD inline float Above(float x) { return x + (Abs(x) * kSlack + 1.0e-44f); }
// Infinite ends stay as they are. An end that became infinite by rounding alone becomes finite.
VOXELD_HD inline float BelowEnd(float x) {
  return x == Infinity() ? 3.0e38f : (x == -Infinity() ? x : Below(x));
}
VOXELD_HD inline float AboveEnd(float x) {
  return x == -Infinity() ? -3.0e38f : (x == Infinity() ? x : Above(x));
}

VOXELD_INTERVAL Cbrt(const Interval& a) {
  return {BelowEnd(Cbrt(a.lo)), AboveEnd(Cbrt(a.hi)), a.nan};
}

// Rounded products of monotonic factors of one sign are monotonic.
VOXELD_INTERVAL PowI(const Interval& a, int32_t n) {
  const int32_t m = n < 0 ? -n : n;
  const Interval b = m % 2 != 0 ? a : Abs(a);
  const Interval power = {PowI(b.lo, m), PowI(b.hi, m), a.nan};
  return n < 0 ? Div(Interval{1, 1, false}, power) : power;
}

VOXELD_INTERVAL Exp(const Interval& a) {
  const float lo = BelowEnd(Exp(a.lo));
  return {lo > 0 ? lo : 0, AboveEnd(Exp(a.hi)), a.nan};
}
VOXELD_INTERVAL Log(const Interval& a) {
  if (!(a.hi > 0)) {
    return {-Infinity(), -Infinity(), true};
  }
  const float lo = a.lo > 0 ? Log(a.lo) : -Infinity(), hi = Log(a.hi);
  return {BelowEnd(lo) - kSlack, AboveEnd(hi) + kSlack, a.nan || a.lo < 0};
}

// Returns the sine of x + quarters·π/2.
VOXELD_INTERVAL SineOf(const Interval& a, int32_t quarters) {
  const float lo = a.lo, hi = a.hi;
  const bool lost = !(lo >= -kMostAngle && hi <= kMostAngle);
  const Interval all = {-1.0f - kSlack, 1.0f + kSlack, a.nan || lost};
  if (lost) return all;
  // The angle in quarter turns, with a margin that exceeds rounding.
  constexpr double kTurns = 0.63661977236758134, kRoom = 1e-6;
  const double from = static_cast<double>(lo) * kTurns + quarters - kRoom;
  const double to = static_cast<double>(hi) * kTurns + quarters + kRoom;
  if (to - from >= 4) return all;
  const float s = SineOf(lo, quarters), t = SineOf(hi, quarters);
  Interval result = {(s < t ? s : t) - kSlack, (s < t ? t : s) + kSlack, a.nan};
  // Tests whether 1 + 4i or 3 + 4i lies between the ends, that is, whether the number of such
  // angles below them differs.
  const auto below = [](double quarter, double phase) {
    const double q = (quarter - phase) * 0.25;
    int64_t i = static_cast<int64_t>(q);
    if (static_cast<double>(i) > q) --i;
    return i;
  };
  if (below(from, 1) != below(to, 1)) result.hi = all.hi;
  if (below(from, 3) != below(to, 3)) result.lo = all.lo;
  return result;
}
VOXELD_HD inline Interval Sin(const Interval& a) { return SineOf(a, 0); }
VOXELD_HD inline Interval Cos(const Interval& a) { return SineOf(a, 1); }

VOXELD_HD inline Interval Min(const Interval& a, const Interval& b) {
  // If one of the values is NaN, the result is the other.
  float hi = a.hi < b.hi ? a.hi : b.hi;
  if (a.nan && b.hi > hi) hi = b.hi;
  if (b.nan && a.hi > hi) hi = a.hi;
  return {a.lo < b.lo ? a.lo : b.lo, hi, a.nan && b.nan};
}
VOXELD_HD inline Interval Max(const Interval& a, const Interval& b) {
  return {a.lo > b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi, a.nan || b.nan};
}

// The extremes are at corners, unless the box meets the cut along the negative x axis.
VOXELD_INTERVAL Atan2(const Interval& y, const Interval& x) {
  const bool nan = x.nan || y.nan;
  if (x.lo <= 0 && HasZero(y)) return {-3.14159274f - kSlack, 3.14159274f + kSlack, nan};
  const Interval box =
      OfCorners(Atan2(y.lo, x.lo), Atan2(y.lo, x.hi), Atan2(y.hi, x.lo), Atan2(y.hi, x.hi), nan);
  return {box.lo - 2 * kSlack, box.hi + 2 * kSlack, nan};
}

#undef VOXELD_INTERVAL

}  // namespace voxeld::gpu::implicit
