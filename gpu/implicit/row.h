// As many numbers as a compiler can take at once: what expressions are computed on by the CPU. Each
// is what single precision gives by itself.
#pragma once

#include <cstddef>

#include "gpu/implicit/dual.h"

namespace voxeld::gpu::implicit {

inline constexpr size_t kRowNumbers = 20;  // a tile's 16 and one at either end, in whole vectors

struct Row {
  float at[kRowNumbers];
};

template <typename F>
Row EachOf(F&& f) {
  Row r;
  for (size_t i = 0; i < kRowNumbers; ++i) r.at[i] = f(i);
  return r;
}

inline Row ConstantLike(const Row&, float value) {
  return EachOf([&](size_t) { return value; });
}

#define VOXELD_ROW_OF_ONE(F)                             \
  inline Row F(const Row& a) {                           \
    return EachOf([&](size_t i) { return F(a.at[i]); }); \
  }
#define VOXELD_ROW_OF_TWO(F)                                      \
  inline Row F(const Row& a, const Row& b) {                      \
    return EachOf([&](size_t i) { return F(a.at[i], b.at[i]); }); \
  }
VOXELD_ROW_OF_ONE(Neg)
VOXELD_ROW_OF_ONE(Abs)
VOXELD_ROW_OF_ONE(Square)
VOXELD_ROW_OF_ONE(Sqrt)
VOXELD_ROW_OF_ONE(Cbrt)
VOXELD_ROW_OF_ONE(Sin)
VOXELD_ROW_OF_ONE(Cos)
VOXELD_ROW_OF_ONE(Exp)
VOXELD_ROW_OF_ONE(Log)
VOXELD_ROW_OF_ONE(Floor)
VOXELD_ROW_OF_TWO(Add)
VOXELD_ROW_OF_TWO(Sub)
VOXELD_ROW_OF_TWO(Mul)
VOXELD_ROW_OF_TWO(Div)
VOXELD_ROW_OF_TWO(Min)
VOXELD_ROW_OF_TWO(Max)
VOXELD_ROW_OF_TWO(Atan2)
#undef VOXELD_ROW_OF_ONE
#undef VOXELD_ROW_OF_TWO

inline Row PowI(const Row& a, int32_t n) {
  return EachOf([&](size_t i) { return PowI(a.at[i], n); });
}

using DualRow = Dual<Row>;

template <typename First>
DualRow Picked(const DualRow& a, const DualRow& b, First&& first) {
  const auto pick = [&](const Row& x, const Row& y) {
    return EachOf([&](size_t i) { return first(i) ? x.at[i] : y.at[i]; });
  };
  return {pick(a.value, b.value),
          {pick(a.d[0], b.d[0]), pick(a.d[1], b.d[1]), pick(a.d[2], b.d[2])}};
}
inline DualRow Abs(const DualRow& a) {
  return Picked(Neg(a), a, [&](size_t i) { return a.value.at[i] < 0; });
}
inline DualRow Min(const DualRow& a, const DualRow& b) {
  return Picked(a, b, [&](size_t i) { return FirstIsMin(a.value.at[i], b.value.at[i]); });
}
inline DualRow Max(const DualRow& a, const DualRow& b) {
  return Picked(a, b, [&](size_t i) { return FirstIsMax(a.value.at[i], b.value.at[i]); });
}

}  // namespace voxeld::gpu::implicit
