// The functions of expressions in IEEE single precision, with the same bits on host and device: no
// contraction, no libm. Square roots and the four operations are the machine's, correctly rounded.
// The others are polynomials whose relative errors (absolute errors of sine, cosine and arc
// tangent) are below 2⁻²¹ (tests/gpu/implicit/number_test.cc checks this against double precision).
#pragma once

#include <cstdint>
#include <cstring>

#include "gpu/portable.h"

namespace voxeld::gpu::implicit {

VOXELD_HD inline uint32_t BitsOf(float x) {
  uint32_t bits;
  std::memcpy(&bits, &x, sizeof(bits));
  return bits;
}
VOXELD_HD inline float FromBits(uint32_t bits) {
  float x;
  std::memcpy(&x, &bits, sizeof(x));
  return x;
}
VOXELD_HD inline float Infinity() { return FromBits(0x7F800000u); }
VOXELD_HD inline float NotANumber() { return FromBits(0x7FC00000u); }
VOXELD_HD inline bool IsNan(float x) { return !(x == x); }
VOXELD_HD inline bool IsFinite(float x) { return (BitsOf(x) & 0x7F800000u) != 0x7F800000u; }

VOXELD_HD inline float Add(float a, float b) { return a + b; }
VOXELD_HD inline float Sub(float a, float b) { return a - b; }
VOXELD_HD inline float Mul(float a, float b) { return a * b; }
VOXELD_HD inline float Div(float a, float b) { return a / b; }
VOXELD_HD inline float Neg(float a) { return -a; }
VOXELD_HD inline float Abs(float a) { return a < 0 ? -a : a; }
VOXELD_HD inline float Square(float a) { return a * a; }

// NaN counts as outside: greater than everything. So a union has the other part's value, and an
// intersection has none.
VOXELD_HD inline bool FirstIsMin(float a, float b) { return !IsNan(a) && (IsNan(b) || a <= b); }
VOXELD_HD inline float Min(float a, float b) { return FirstIsMin(a, b) ? a : b; }
VOXELD_HD inline bool FirstIsMax(float a, float b) { return IsNan(a) || (!IsNan(b) && a >= b); }
VOXELD_HD inline float Max(float a, float b) { return FirstIsMax(a, b) ? a : b; }

VOXELD_HD inline float Sqrt(float x) {
#if defined(__CUDA_ARCH__)
  return __fsqrt_rn(x);
#else
  return x < 0 ? NotANumber() : __builtin_sqrtf(x);
#endif
}

VOXELD_HD inline float Floor(float x) {
  if (!(x > -8388608.0f && x < 8388608.0f)) return x;
  const float t = static_cast<float>(static_cast<int32_t>(x));
  return t > x ? t - 1.0f : t;
}

// Uses Newton's steps in double precision and rounds once.
VOXELD_HD inline float Cbrt(float x) {
  const float a = Abs(x);
  if (!(a > 0) || !IsFinite(a)) return x;
  const double d = static_cast<double>(a);
  uint64_t bits;
  std::memcpy(&bits, &d, sizeof(bits));
  bits = bits / 3 + 0x2A9F7893782DA1CEull;
  double y;
  std::memcpy(&y, &bits, sizeof(y));
  for (int i = 0; i < 4; ++i) y = y - (y * y * y - d) / (3.0 * (y * y));
  return x < 0 ? -static_cast<float>(y) : static_cast<float>(y);
}

// Computes x^n by squaring; for a negative exponent, the reciprocal of that.
VOXELD_HD inline float PowI(float x, int32_t n) {
  uint32_t left = n < 0 ? 0u - static_cast<uint32_t>(n) : static_cast<uint32_t>(n);
  const bool negative = x < 0 && (left & 1) != 0;
  float power = Abs(x), result = 1.0f;
  for (; left != 0; left >>= 1) {
    if ((left & 1) != 0) result = result * power;
    power = power * power;
  }
  if (negative) result = -result;
  return n < 0 ? 1.0f / result : result;
}

// Beyond this angle sine and cosine are NaN: single precision has lost the angle.
inline constexpr float kMostAngle = 1048576.0f;

// x = quarter·π/2 + rest, |rest| is at most slightly more than π/4; |x| ≤ kMostAngle.
struct Angle {
  float rest;
  int32_t quarter;
  VOXELD_HD static Angle Of(float x) {
    Angle angle;
    if (x > -8192.0f && x < 8192.0f) {
      // π/2 is split into parts whose products with the quarter, of 13 bits, are exact except for
      // the last.
      const float k = Floor(x * 0.636619772f + 0.5f);
      angle.rest = ((x - k * 1.5703125f) - k * 4.8375129699707031e-4f) - k * 7.5497899548918821e-8f;
      angle.quarter = static_cast<int32_t>(k);
      return angle;
    }
    const double d = static_cast<double>(x), q = d * 0.63661977236758134 + 0.5;
    int64_t k = static_cast<int64_t>(q);
    if (static_cast<double>(k) > q) --k;
    const double n = static_cast<double>(k);
    angle.rest = static_cast<float>((d - n * 1.5707963267341256) - n * 6.0771005065061922e-11);
    angle.quarter = static_cast<int32_t>(k & 3);
    return angle;
  }
};

// Returns the sine of an angle of at most slightly more than π/4.
VOXELD_HD inline float SineOfRest(float r) {
  const float z = r * r;
  return r + (r * z) * (-0.166666552f + z * (0.00833217241f + z * -0.000195164801f));
}
VOXELD_HD inline float CosineOfRest(float r) {
  const float z = r * r;
  return (1.0f - 0.5f * z) +
         (z * z) * (0.0416666456f + z * (-0.00138873595f + z * 2.44375333e-05f));
}

// Returns the sine of x + quarters·π/2.
VOXELD_HD inline float SineOf(float x, int32_t quarters) {
  if (!(Abs(x) <= kMostAngle)) return NotANumber();
  const Angle angle = Angle::Of(x);
  const int32_t quarter = (angle.quarter + quarters) & 3;
  const float y = (quarter & 1) != 0 ? CosineOfRest(angle.rest) : SineOfRest(angle.rest);
  return (quarter & 2) != 0 ? -y : y;
}
VOXELD_HD inline float Sin(float x) { return SineOf(x, 0); }
VOXELD_HD inline float Cos(float x) { return SineOf(x, 1); }

VOXELD_HD inline float PowerOfTwo(int32_t n) {  // −126 to 127
  return FromBits(static_cast<uint32_t>(n + 127) << 23);
}

VOXELD_HD inline float Exp(float x) {
  if (IsNan(x)) return x;
  if (x > 88.7228394f) return Infinity();
  if (x < -104.0f) return 0;
  const float k = Floor(x * 1.44269504f + 0.5f);
  const float r = (x - k * 0.693359375f) + k * 2.12194440e-4f;
  const float p =
      0.5f + r * (0.166665167f + r * (0.0416662022f + r * (0.00836908817f + r * 0.0013950835f)));
  const float y = (r * r) * p + r + 1.0f;
  const int32_t n = static_cast<int32_t>(k), half = n / 2;
  return y * PowerOfTwo(half) * PowerOfTwo(n - half);
}

VOXELD_HD inline float Log(float x) {
  if (!(x > 0)) return x == 0 ? -Infinity() : NotANumber();
  if (!IsFinite(x)) return x;
  int32_t exponent = 0;
  if (x < 1.17549435e-38f) {
    x = x * 8388608.0f;
    exponent = -23;
  }
  uint32_t bits = BitsOf(x);
  exponent += static_cast<int32_t>(bits >> 23) - 127;
  float m = FromBits((bits & 0x007FFFFFu) | 0x3F800000u);
  if (m > 1.41421356f) {
    m = m * 0.5f;
    ++exponent;
  }
  const float f = m - 1.0f, z = f * f, n = static_cast<float>(exponent);
  const float p =
      0.333333164f +
      f * (-0.250008255f +
           f * (0.200023741f +
                f * (-0.166239992f +
                     f * (0.141788244f +
                          f * (-0.131322175f + f * (0.129001677f + f * -0.0787291974f))))));
  return ((f * z) * p + n * -2.12194440e-4f - 0.5f * z) + f + n * 0.693359375f;
}

// Returns the angle of (x, y), −π to π; 0 at the origin.
VOXELD_HD inline float Atan2(float y, float x) {
  if (IsNan(x) || IsNan(y)) return NotANumber();
  const float ax = Abs(x), ay = Abs(y);
  const bool steep = ay > ax;
  const float most = steep ? ay : ax, least = steep ? ax : ay;
  if (most == 0) return 0;
  const float t = IsFinite(least) ? least / most : 1.0f, z = t * t;
  const float p =
      -0.333331674f +
      z * (0.199941367f +
           z * (-0.142142087f +
                z * (0.106789395f +
                     z * (-0.0758057609f +
                          z * (0.0435535163f + z * (-0.0165811684f + z * 0.00297458656f))))));
  float a = t + (t * z) * p;
  if (steep) a = 1.57079633f - a;
  if (x < 0) a = 3.14159265f - a;
  return y < 0 ? -a : a;
}

VOXELD_HD inline float ConstantLike(float, float value) { return value; }

}  // namespace voxeld::gpu::implicit
