// Lines one voxel wide, of one colour, within a bounded space: the same voxels as line.h's in 32-bit
// arithmetic, cut into spans that each lie in one box of a grid of boxes.
//
// Of voxel_k = ⌊(S·N + D·k) / (256·N)⌋ (line.h; S and D = E − S in units) three things are needed.
//
// Crossings: the least k whose voxel lies at or beyond a face b on an axis. An estimate in single
// precision, k ≈ (b − S)·N / D, is off by less than ½ (relative error 3·2⁻²³, N ≤ kMaxThinSteps), so
// rounded to nearest it is the answer or one less, and the sign of (S − b)·N + D·k tells which. At
// such a k that number is less than 3·|D|, so it may be computed modulo 2³².
//
// Boxes: which box holds voxel_k: an estimate is off by one at most, and the same number tells.
//
// Steps: inside a box of 32 voxels a coordinate is kept as 5.27 bits, modulo 32. It begins at the
// exact position rounded up and 2⁻²⁷ more, and each step adds D / (256·N) rounded up, or less than it
// by 2⁻³⁷; so after j ≤ kMaxSpan steps it is too great, by less than (1.01·j + 2.1)·2⁻²⁷. Exact
// positions are multiples of 1 / (256·N): the next whole number above one that is not whole is at
// least that far away, so floors agree while (1.01·j + 2.1)·2⁻²⁷ < 1 / (256·N). In a box no line has
// more than kMaxSpan voxels (EUCLIDEAN lines advance by 1/√3 on their greatest axis at least), and
// (1.01·57 + 2.1)·8,700 < 2¹⁹.
#pragma once

#include <cstdint>

#include "gpu/primitives/line.h"

namespace voxeld::gpu {

inline constexpr int32_t kMaxThinSteps = 8700;
inline constexpr uint32_t kMaxSpan = 57;  // voxels of a line in a box of 32

// 32 bytes, read as two times 16.
struct alignas(16) ThinLine {
  int32_t s[3];   // units
  int32_t n;      // N; 0: the voxel of S alone
  int32_t d[3];   // units; 0 if n is
  uint32_t word;  // gpu/word.h; 0: draws nothing
};

// Whether all lines with both ends in a box of these positions (in voxels, closed) can be thin lines.
VOXELD_HD inline bool AreThin(const double lo[3], const double hi[3]) {
  double square = 0;
  for (int a = 0; a < 3; ++a) {
    if (!(lo[a] > -16383.0 && hi[a] < 16383.0)) return false;
    square += (hi[a] - lo[a]) * (hi[a] - lo[a]);
  }
  return square < (kMaxThinSteps - 8.0) * (kMaxThinSteps - 8.0);
}

// THIN or EUCLIDEAN; `word` its voxels'. Where N = 0, two ends in different voxels are the two
// voxels of a line with one step.
VOXELD_HD inline ThinLine MakeThin(const Line& line, uint32_t word) {
  ThinLine t;
  int64_t n = LineSteps(line);
  if (n == 0) {
    bool apart = false;
    for (int a = 0; a < 3; ++a) apart |= VoxelOf(line.s[a]) != VoxelOf(line.e[a]);
    n = apart ? 1 : 0;
  }
  t.n = static_cast<int32_t>(n);
  t.word = word;
  for (int a = 0; a < 3; ++a) {
    t.s[a] = static_cast<int32_t>(line.s[a]);
    t.d[a] = n == 0 ? 0 : static_cast<int32_t>(line.e[a] - line.s[a]);
  }
  return t;
}

VOXELD_HD inline int32_t WrapMul(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) * static_cast<uint32_t>(b));
}
VOXELD_HD inline int32_t WrapAdd(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) + static_cast<uint32_t>(b));
}

// To the nearest whole number; |x| < 2²².
VOXELD_HD inline int32_t RoundNear(float x) {
  const float shifted = x + 12582912.0f;  // 1.5·2²³
  int32_t bits;
#if defined(__CUDA_ARCH__)
  bits = __float_as_int(shifted);
#else
  std::memcpy(&bits, &shifted, sizeof(bits));
#endif
  return bits - 0x4B400000;
}

// An estimate: 2 units in the last place off.
VOXELD_HD inline float Quotient(float a, float b) {
#if defined(__CUDA_ARCH__)
  return __fdividef(a, b);
#else
  return a / b;
#endif
}

// The box, of 2^bits voxels on this axis, that holds voxel_k; k ≤ n.
VOXELD_HD inline int32_t BoxAt(const ThinLine& line, int a, int32_t k, int bits) {
  const int32_t m = Max(line.n, 1);
  const float at =
      static_cast<float>(line.s[a]) +
      static_cast<float>(line.d[a]) * Quotient(static_cast<float>(k), static_cast<float>(m));
  // Rounded to nearest, less a half: one too few at the most, or, by the estimate, one too many.
  int32_t box = RoundNear(at / static_cast<float>(kUnitsPerVoxel << bits) - 0.5f);
  const int32_t past =
      WrapAdd(WrapMul(line.s[a] - WrapMul(box, 256 << bits), m), WrapMul(line.d[a], k));
  if (past < 0) --box;
  if (past >= m << (8 + bits)) ++box;
  return box;
}

// One axis of a walk from box to box.
struct ThinAxis {
  int32_t box;         // that the line is in
  int32_t next;        // the k at which it comes into the next one, n + 1: never
  int32_t base;        // (S − face)·N modulo 2³²
  float gap, inverse;  // face − S; N / D

  // At the face that `box` has ahead.
  VOXELD_HD void Find(int32_t d, int32_t n) {
    const float x = gap * inverse;
    next = n + 1;
    if (!(x < static_cast<float>(n + 2))) return;  // infinite where D = 0
    int32_t k = RoundNear(x);
    const int32_t past = WrapAdd(base, WrapMul(d, k));
    k += (past < 0) != (d < 0) ? 1 : 0;
    next = Min(k, n + 1);
  }
  VOXELD_HD void Begin(const ThinLine& line, int a, int32_t in, int bits) {
    const int32_t s = line.s[a], d = line.d[a], n = line.n;
    box = in;
    const int32_t face = WrapMul(d < 0 ? box : box + 1, 256 << bits);
    gap = static_cast<float>(face - s);
    base = WrapMul(s - face, n);
    inverse =
        d == 0 ? __builtin_huge_valf() : Quotient(static_cast<float>(n), static_cast<float>(d));
    if (d == 0) gap = 1;
    Find(d, n);
  }
  // Into the next box; `size`: of a box, in units, towards it.
  VOXELD_HD void Cross(int32_t d, int32_t n, int32_t size) {
    box += d < 0 ? -1 : 1;
    gap += static_cast<float>(size);
    base = WrapAdd(base, -WrapMul(size, n));
    Find(d, n);
  }
};

// From box to box of a grid, beginning at voxel `k` in box `at`: f(box, k, end) for each box, with
// the voxels k to end − 1 in it; as long as f returns true. bits: log2 of a box's voxels, by axis.
template <class F>
VOXELD_HD void WalkThin(const ThinLine& line, int32_t k, const int32_t at[3], const int bits[3],
                        F&& f) {
  ThinAxis x, y, z;
  x.Begin(line, 0, at[0], bits[0]);
  y.Begin(line, 1, at[1], bits[1]);
  z.Begin(line, 2, at[2], bits[2]);
  const int32_t n = line.n;
  for (;;) {
    const int32_t end = Min(x.next, Min(y.next, z.next));
    const int32_t box[3] = {x.box, y.box, z.box};
    if (end > k && !f(box, k, end)) return;
    if (end > n) return;
    k = end;
    // One face after the other, also where several are met at one voxel: whatever the axis, the same
    // instructions.
    const bool in_x = x.next == k, in_y = !in_x && y.next == k;
    const int32_t d = in_x ? line.d[0] : in_y ? line.d[1] : line.d[2];
    const int32_t size = 256 << (in_x ? bits[0] : in_y ? bits[1] : bits[2]);
    ThinAxis axis = in_x ? x : in_y ? y : z;
    axis.Cross(d, n, d < 0 ? -size : size);
    if (in_x) {
      x = axis;
    } else if (in_y) {
      y = axis;
    } else {
      z = axis;
    }
  }
}

// ⌈2⁵¹ / n⌉, for ThinSteps; n ≥ 1.
VOXELD_HD inline uint64_t ThinReciprocal(int32_t n) {
  const uint64_t m = static_cast<uint64_t>(n);
  return ((uint64_t{1} << 51) + m - 1) / m;
}

// Positions modulo 32 voxels, 5.27 bits.
struct ThinSteps {
  uint32_t at[3], step[3];

  // At voxel k. `reciprocal`: of max(n, 1).
  VOXELD_HD static ThinSteps At(const ThinLine& line, int32_t k, uint64_t reciprocal,
                                const int32_t box[3], int bits_z = 5) {
    ThinSteps t;
    const int32_t m = Max(line.n, 1);
    const uint32_t high = static_cast<uint32_t>(reciprocal >> 32),
                   low = static_cast<uint32_t>(reciprocal);
    for (int a = 0; a < 3; ++a) {
      const int bits = a == 2 ? bits_z : 5;
      // In [0, 2¹³·m); the product is too small by less than 1, or too great by less than 2⁻⁴.
      const uint32_t past = static_cast<uint32_t>(
          WrapAdd(WrapMul(line.s[a] - WrapMul(box[a], 256 << bits), m), WrapMul(line.d[a], k)));
      t.at[a] = past * high + MulHigh(past, low) + 2;
      const uint32_t length = static_cast<uint32_t>(line.d[a] < 0 ? -line.d[a] : line.d[a]);
      const uint32_t ahead = length * high + MulHigh(length, low);
      t.step[a] = line.d[a] < 0 ? 0u - ahead : ahead + 1;
    }
    return t;
  }
  VOXELD_HD static uint32_t MulHigh(uint32_t a, uint32_t b) {
#if defined(__CUDA_ARCH__)
    return __umulhi(a, b);
#else
    return static_cast<uint32_t>(static_cast<uint64_t>(a) * b >> 32);
#endif
  }
};

// The same as 32.32 bits: a step is an addition with its carry, and the voxel, modulo 2³², is the upper
// half as it stands.
struct ThinCursor {
  uint64_t at[3], step[3];

  VOXELD_HD explicit ThinCursor(const ThinSteps& steps) {
    for (int a = 0; a < 3; ++a) {
      at[a] = static_cast<uint64_t>(steps.at[a]) << 5;
      step[a] = static_cast<uint64_t>(static_cast<int64_t>(static_cast<int32_t>(steps.step[a])))
                << 5;
    }
  }
  VOXELD_HD uint32_t voxel(int a) const { return static_cast<uint32_t>(at[a] >> 32); }
  VOXELD_HD void Next() {
    for (int a = 0; a < 3; ++a) at[a] += step[a];
  }
};

}  // namespace voxeld::gpu
