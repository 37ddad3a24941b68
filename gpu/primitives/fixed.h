// Exact arithmetic on positions in units of 2⁻⁸ voxel. Host and device; no libm.
#pragma once

#include <cstdint>

#include "gpu/portable.h"

namespace voxeld::gpu {

inline constexpr int64_t kUnitsPerVoxel = 256;
inline constexpr int64_t kHalfVoxel = kUnitsPerVoxel / 2;
inline constexpr int64_t kMaxUnits = int64_t{1} << 38;  // positions saturate at ±2³⁰ voxels

// For values that do not fit in 64 bits.
using Wide = __int128;

// A position in units, or a difference of two.
struct Int3 {
  int64_t v[3] = {};
  VOXELD_HD int64_t& operator[](int axis) { return v[axis]; }
  VOXELD_HD int64_t operator[](int axis) const { return v[axis]; }
};

// Voxels, half-open.
struct Box3 {
  int32_t lo[3] = {}, hi[3] = {};
};

template <class I>
VOXELD_HD constexpr I Min(I a, I b) {
  return b < a ? b : a;
}
template <class I>
VOXELD_HD constexpr I Max(I a, I b) {
  return a < b ? b : a;
}
template <class I>
VOXELD_HD constexpr I Abs(I a) {
  return a < 0 ? -a : a;
}
template <class I>
VOXELD_HD constexpr I Clamp(I v, I lo, I hi) {
  return v < lo ? lo : (hi < v ? hi : v);
}

// Returns the intersection; an empty one has no negative sizes.
VOXELD_HD inline Box3 Intersect(const Box3& a, const Box3& b) {
  Box3 r;
  for (int i = 0; i < 3; ++i) {
    r.lo[i] = Max(a.lo[i], b.lo[i]);
    r.hi[i] = Max(r.lo[i], Min(a.hi[i], b.hi[i]));
  }
  return r;
}

VOXELD_HD constexpr bool IsEmpty(const Box3& b) {
  return b.hi[0] <= b.lo[0] || b.hi[1] <= b.lo[1] || b.hi[2] <= b.lo[2];
}

VOXELD_HD constexpr bool Contains(const Box3& box, int64_t x, int64_t y, int64_t z) {
  return x >= box.lo[0] && x < box.hi[0] && y >= box.lo[1] && y < box.hi[1] && z >= box.lo[2] &&
         z < box.hi[2];
}

// Divides and rounds towards −∞ or +∞. Requires: b > 0.
template <class I>
VOXELD_HD constexpr I FloorDiv(I a, I b) {
  const I q = a / b;
  return q - static_cast<I>(q * b > a);
}
template <class I>
VOXELD_HD constexpr I CeilDiv(I a, I b) {
  const I q = a / b;
  return q + static_cast<I>(q * b < a);
}

// Returns the voxel that holds a coordinate in units.
VOXELD_HD constexpr int64_t VoxelOf(int64_t units) { return units >> 8; }

// Returns the next whole number at or below x. Requires: |x| < 2⁶².
VOXELD_HD constexpr int64_t FloorToInt(double x) {
  const int64_t t = static_cast<int64_t>(x);
  return t - static_cast<int64_t>(static_cast<double>(t) > x);
}

// Rounds a coordinate in voxels to the nearest unit, halves up; saturates at ±kMaxUnits (NaN: at
// −kMaxUnits).
VOXELD_HD constexpr int64_t Snap(double voxels) {
  const double x = voxels * 256.0 + 0.5;
  if (!(x > -static_cast<double>(kMaxUnits))) return -kMaxUnits;
  if (x >= static_cast<double>(kMaxUnits)) return kMaxUnits;
  return FloorToInt(x);
}

VOXELD_HD constexpr int32_t ToVoxel32(int64_t v) {
  return static_cast<int32_t>(Clamp<int64_t>(v, INT32_MIN, INT32_MAX));
}

// IEEE, correctly rounded on host and device.
VOXELD_HD inline double SquareRoot(double x) {
#if defined(__CUDA_ARCH__)
  return __dsqrt_rn(x);
#else
  return __builtin_sqrt(x);
#endif
}

// Returns ⌊√x⌋. Requires: x ≥ 0.
VOXELD_HD inline int64_t FloorSqrt(Wide x) {
  int64_t r = static_cast<int64_t>(SquareRoot(static_cast<double>(x)));
  while (static_cast<Wide>(r) * r > x) --r;
  while (static_cast<Wide>(r + 1) * (r + 1) <= x) ++r;
  return r;
}

// Computes ⌊(start + step·k) / modulus⌋ for consecutive k, exactly and without division.
struct Stepper {
  int64_t value, rest, value_step, rest_step, modulus;

  // `numerator` is the value at the first k; |step| is at most a small multiple of `modulus`.
  template <class I>
  VOXELD_HD static Stepper At(I numerator, int64_t step, int64_t modulus) {
    Stepper s;
    const I q = FloorDiv<I>(numerator, modulus);
    s.value = static_cast<int64_t>(q);
    s.rest = static_cast<int64_t>(numerator - q * modulus);
    s.value_step = 0;
    s.rest_step = step;
    s.modulus = modulus;
    while (s.rest_step < 0) s.rest_step += modulus, --s.value_step;
    while (s.rest_step >= modulus) s.rest_step -= modulus, ++s.value_step;
    return s;
  }

  VOXELD_HD void Next() {
    rest += rest_step;
    const int64_t carry = rest >= modulus;
    rest -= modulus & -carry;
    value += value_step + carry;
  }
};

// Returns the colour k parts of n along from c0 to c1 (0x00RRGGBB): (C0·(n−k) + C1·k + ⌊n/2⌋)/n for
// each channel.
VOXELD_HD inline uint32_t MixColors(uint32_t c0, uint32_t c1, int64_t k, int64_t n) {
  if (c0 == c1 || n == 0) return c0;
  uint32_t rgb = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    const int64_t a = (c0 >> shift) & 0xFF, b = (c1 >> shift) & 0xFF;
    rgb |= static_cast<uint32_t>((a * (n - k) + b * k + n / 2) / n) << shift;
  }
  return rgb;
}

}  // namespace voxeld::gpu
