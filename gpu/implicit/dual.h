// Forward-mode derivatives: a value and its gradient along the three axes of voxel space, in single
// precision or in intervals of it. With intervals the same operations are done in the same order,
// so that the intervals contain the values that single precision computes.
#pragma once

#include "gpu/implicit/interval.h"

namespace voxeld::gpu::implicit {

template <class N>
struct Dual {
  N value;
  N d[3];
};

template <class N, class F>
VOXELD_HD Dual<N> WithGradient(const N& value, F&& f) {
  return {value, {f(0), f(1), f(2)}};
}

template <class N>
VOXELD_HD Dual<N> ConstantLike(const Dual<N>& like, float value) {
  const N zero = ConstantLike(like.value, 0.0f);
  return {ConstantLike(like.value, value), {zero, zero, zero}};
}

template <class N>
VOXELD_HD Dual<N> Add(const Dual<N>& a, const Dual<N>& b) {
  return WithGradient(Add(a.value, b.value), [&](int i) { return Add(a.d[i], b.d[i]); });
}
template <class N>
VOXELD_HD Dual<N> Sub(const Dual<N>& a, const Dual<N>& b) {
  return WithGradient(Sub(a.value, b.value), [&](int i) { return Sub(a.d[i], b.d[i]); });
}
template <class N>
VOXELD_HD Dual<N> Neg(const Dual<N>& a) {
  return WithGradient(Neg(a.value), [&](int i) { return Neg(a.d[i]); });
}
template <class N>
VOXELD_HD Dual<N> Mul(const Dual<N>& a, const Dual<N>& b) {
  return WithGradient(Mul(a.value, b.value),
                      [&](int i) { return Add(Mul(a.d[i], b.value), Mul(a.value, b.d[i])); });
}
template <class N>
VOXELD_HD Dual<N> Div(const Dual<N>& a, const Dual<N>& b) {
  const N quotient = Div(a.value, b.value);
  return WithGradient(quotient,
                      [&](int i) { return Div(Sub(a.d[i], Mul(quotient, b.d[i])), b.value); });
}
// Returns the dual of f(a), where f'(a) = slope.
template <class N>
VOXELD_HD Dual<N> Chain(const N& value, const N& slope, const Dual<N>& a) {
  return WithGradient(value, [&](int i) { return Mul(slope, a.d[i]); });
}
template <class N>
VOXELD_HD Dual<N> Square(const Dual<N>& a) {
  return Chain(Square(a.value), Add(a.value, a.value), a);
}
template <class N>
VOXELD_HD Dual<N> Sqrt(const Dual<N>& a) {
  const N root = Sqrt(a.value);
  return Chain(root, Div(ConstantLike(root, 0.5f), root), a);
}
template <class N>
VOXELD_HD Dual<N> Cbrt(const Dual<N>& a) {
  const N root = Cbrt(a.value);
  return Chain(root, Div(ConstantLike(root, 0.333333343f), Square(root)), a);
}
template <class N>
VOXELD_HD Dual<N> Sin(const Dual<N>& a) {
  return Chain(Sin(a.value), Cos(a.value), a);
}
template <class N>
VOXELD_HD Dual<N> Cos(const Dual<N>& a) {
  return Chain(Cos(a.value), Neg(Sin(a.value)), a);
}
template <class N>
VOXELD_HD Dual<N> Exp(const Dual<N>& a) {
  const N value = Exp(a.value);
  return Chain(value, value, a);
}
template <class N>
VOXELD_HD Dual<N> Log(const Dual<N>& a) {
  return Chain(Log(a.value), Div(ConstantLike(a.value, 1.0f), a.value), a);
}
template <class N>
VOXELD_HD Dual<N> Floor(const Dual<N>& a) {
  const N zero = ConstantLike(a.value, 0.0f);
  return {Floor(a.value), {zero, zero, zero}};
}
template <class N>
VOXELD_HD Dual<N> PowI(const Dual<N>& a, int32_t n) {
  const N slope =
      Mul(ConstantLike(a.value, static_cast<float>(n)), PowI(a.value, n == 0 ? 0 : n - 1));
  return Chain(PowI(a.value, n), slope, a);
}
template <class N>
VOXELD_HD Dual<N> Atan2(const Dual<N>& y, const Dual<N>& x) {
  const N length2 = Add(Square(x.value), Square(y.value));
  return WithGradient(Atan2(y.value, x.value), [&](int i) {
    return Div(Sub(Mul(x.value, y.d[i]), Mul(y.value, x.d[i])), length2);
  });
}

// Returns |∇p|.
template <class N>
VOXELD_HD N SlopeOf(const Dual<N>& p) {
  return Sqrt(Add(Add(Square(p.d[0]), Square(p.d[1])), Square(p.d[2])));
}

// For functions that take one of two branches, the gradient is that of the branch taken.
VOXELD_HD inline Dual<float> Abs(const Dual<float>& a) { return a.value < 0 ? Neg(a) : a; }
VOXELD_HD inline Dual<float> Min(const Dual<float>& a, const Dual<float>& b) {
  return FirstIsMin(a.value, b.value) ? a : b;
}
VOXELD_HD inline Dual<float> Max(const Dual<float>& a, const Dual<float>& b) {
  return FirstIsMax(a.value, b.value) ? a : b;
}

using DualInterval = Dual<Interval>;

VOXELD_HD inline DualInterval HullOf(const Interval& value, const DualInterval& a,
                                     const DualInterval& b) {
  return WithGradient(value, [&](int i) { return Hull(a.d[i], b.d[i]); });
}
VOXELD_HD inline DualInterval Abs(const DualInterval& a) {
  if (a.value.lo >= 0) return a;
  const DualInterval negative = Neg(a);
  if (a.value.hi < 0 && !a.value.nan) return negative;
  return HullOf(Abs(a.value), a, negative);
}
VOXELD_HD inline DualInterval Min(const DualInterval& a, const DualInterval& b) {
  if (a.value.hi < b.value.lo && !a.value.nan) return a;
  if (b.value.hi < a.value.lo && !b.value.nan) return b;
  return HullOf(Min(a.value, b.value), a, b);
}
VOXELD_HD inline DualInterval Max(const DualInterval& a, const DualInterval& b) {
  if (a.value.lo > b.value.hi && !b.value.nan) return a;
  if (b.value.lo > a.value.hi && !a.value.nan) return b;
  return HullOf(Max(a.value, b.value), a, b);
}

}  // namespace voxeld::gpu::implicit
