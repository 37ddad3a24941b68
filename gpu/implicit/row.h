// Several numbers side by side, each with the result that single precision gives for it alone.
// Expressions are computed on them, so that an instruction is decoded once for all of them.
#pragma once

#include <cstddef>

#include "gpu/implicit/dual.h"

namespace voxeld::gpu::implicit {

template <size_t n>
struct Lanes {
  float at[n];
};
using Row = Lanes<20>;  // the CPU's: a tile's 16 and one at either end, in whole vectors
using Quad = Lanes<4>;  // the device's

template <size_t n, typename F>
VOXELD_HD Lanes<n> EachOf(F&& f) {
  Lanes<n> r;
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
  for (size_t i = 0; i < n; ++i) r.at[i] = f(i);
  return r;
}

template <size_t n>
VOXELD_HD Lanes<n> ConstantLike(const Lanes<n>&, float value) {
  return EachOf<n>([&](size_t) { return value; });
}

#define VOXELD_LANES_OF_ONE(F)                              \
  template <size_t n>                                       \
  VOXELD_HD Lanes<n> F(const Lanes<n>& a) {                 \
    return EachOf<n>([&](size_t i) { return F(a.at[i]); }); \
  }
#define VOXELD_LANES_OF_TWO(F)                                       \
  template <size_t n>                                                \
  VOXELD_HD Lanes<n> F(const Lanes<n>& a, const Lanes<n>& b) {       \
    return EachOf<n>([&](size_t i) { return F(a.at[i], b.at[i]); }); \
  }
VOXELD_LANES_OF_ONE(Neg)
VOXELD_LANES_OF_ONE(Abs)
VOXELD_LANES_OF_ONE(Square)
VOXELD_LANES_OF_ONE(Sqrt)
VOXELD_LANES_OF_ONE(Cbrt)
VOXELD_LANES_OF_ONE(Sin)
VOXELD_LANES_OF_ONE(Cos)
VOXELD_LANES_OF_ONE(Exp)
VOXELD_LANES_OF_ONE(Log)
VOXELD_LANES_OF_ONE(Floor)
VOXELD_LANES_OF_TWO(Add)
VOXELD_LANES_OF_TWO(Sub)
VOXELD_LANES_OF_TWO(Mul)
VOXELD_LANES_OF_TWO(Div)
VOXELD_LANES_OF_TWO(Min)
VOXELD_LANES_OF_TWO(Max)
VOXELD_LANES_OF_TWO(Atan2)
#undef VOXELD_LANES_OF_ONE
#undef VOXELD_LANES_OF_TWO

template <size_t n>
VOXELD_HD Lanes<n> PowI(const Lanes<n>& a, int32_t exponent) {
  return EachOf<n>([&](size_t i) { return PowI(a.at[i], exponent); });
}

// Returns a value that is the same in all lanes, or a single one.
template <class N>
VOXELD_HD N Spread(const N& value, const N&) {
  return value;
}
template <size_t n>
VOXELD_HD Lanes<n> Spread(float value, const Lanes<n>& like) {
  return ConstantLike(like, value);
}

using DualRow = Dual<Row>;

template <size_t n, typename First>
VOXELD_HD Dual<Lanes<n>> Picked(const Dual<Lanes<n>>& a, const Dual<Lanes<n>>& b, First&& first) {
  const auto pick = [&](const Lanes<n>& x, const Lanes<n>& y) {
    return EachOf<n>([&](size_t i) { return first(i) ? x.at[i] : y.at[i]; });
  };
  return {pick(a.value, b.value),
          {pick(a.d[0], b.d[0]), pick(a.d[1], b.d[1]), pick(a.d[2], b.d[2])}};
}
template <size_t n>
VOXELD_HD Dual<Lanes<n>> Abs(const Dual<Lanes<n>>& a) {
  return Picked(Neg(a), a, [&](size_t i) { return a.value.at[i] < 0; });
}
template <size_t n>
VOXELD_HD Dual<Lanes<n>> Min(const Dual<Lanes<n>>& a, const Dual<Lanes<n>>& b) {
  return Picked(a, b, [&](size_t i) { return FirstIsMin(a.value.at[i], b.value.at[i]); });
}
template <size_t n>
VOXELD_HD Dual<Lanes<n>> Max(const Dual<Lanes<n>>& a, const Dual<Lanes<n>>& b) {
  return Picked(a, b, [&](size_t i) { return FirstIsMax(a.value.at[i], b.value.at[i]); });
}

}  // namespace voxeld::gpu::implicit
