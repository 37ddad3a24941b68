// Lines one voxel wide, in one colour, within a bounded space: the same voxels as line.h's in
// 32-bit arithmetic, cut into spans that each lie in one box of a grid of boxes.
//
// Three things about voxel_k = ⌊(S·N + D·k) / (256·N)⌋ (line.h; S and D = E − S in units) are
// needed.
//
// Crossings: the least k whose voxel lies at or beyond a face b on an axis. An estimate in single
// precision, k ≈ (b − S)·N / D, is off by less than ½ (relative error 3·2⁻²³, N ≤ kMaxThinSteps),
// so rounded to nearest it is the answer or one less, and the sign of (S − b)·N + D·k tells which.
// At such a k that number is less than 3·|D|, so it may be computed modulo 2³².
//
// Boxes: the box that holds voxel_k. An estimate is off by at most one, and the same number
// decides.
//
// Steps: inside a box of 2^b voxels a coordinate is stored in 32 bits, b before the point, modulo
// 2^b (b: kTrackBits). Let a unit be its last bit, 2⁻²⁷ voxel or less. A line stores its step δ = D
// / (256·N) in 64 bits: it is at least δ, and too great by less than 2.2·2⁻⁴⁶. So k times the step,
// taken as its upper half plus one unit, exceeds its exact value by less than 1.04 units while k ≤
// kMaxThinSteps; and the step's own upper half plus one unit does so by at most 1.01. After j ≤
// kMaxSpan − 1 steps a position is too great by less than 1.04 + 1.01·j units. Exact positions are
// multiples of 1 / (256·N): the next whole number above one that is not whole is at least that far
// away, so floors agree while (1.04 + 1.01·j)·2⁻²⁷ < 1 / (256·N). In a box no line has more than
// kMaxSpan voxels (EUCLIDEAN lines advance by at least 1/√3 on their greatest axis), and (1.04 +
// 1.01·56)·8,700 < 2¹⁹.
#pragma once

#include <cstdint>
#include <cstring>

#include "gpu/primitives/line.h"

namespace voxeld::gpu {

inline constexpr int32_t kMaxThinSteps = 8700;
inline constexpr uint32_t kMaxSpan = 57;  // voxels of a line in a box of 32

// The boxes in which lines are drawn: log2 of their voxels by axis.
VOXELD_HD inline constexpr int TrackBits(int axis) { return axis == 2 ? 4 : 5; }

// The data of a line for sorting.
struct alignas(16) ThinLine {
  int32_t s[3];   // units
  int32_t n;      // N; 0: the voxel of S alone
  int32_t d[3];   // units; 0 if n is
  uint32_t word;  // gpu/word.h; 0: draws nothing
};

// The data of a line for drawing. For each axis: the step, modulo 2^b voxels with b =
// TrackBits(axis) bits before the point, in all but the low 13 bits; and in those, S, modulo 2^b
// voxels, in units.
struct alignas(16) ThinTrack {
  static constexpr int kPlaceBits = 13;
  uint64_t axis[3];
  uint32_t word;  // as the line's
  int32_t n;      // as the line's
};

// Packs S and D (in units) of an axis; m = max(N, 1).
VOXELD_HD inline uint64_t TrackAxis(int32_t s, int32_t d, int32_t m, int axis) {
  const int bits = TrackBits(axis);
  // D / N is below 2¹⁰, and its quotient is off by at most 2⁻⁶.
  const double step = static_cast<double>(d) / static_cast<double>(m) *
                      static_cast<double>(int64_t{1} << (64 - bits - 8 - ThinTrack::kPlaceBits));
  const double above = step + 1.03125;
  int64_t rounded = static_cast<int64_t>(above);
  if (static_cast<double>(rounded) > above) --rounded;
  return static_cast<uint64_t>(rounded) << ThinTrack::kPlaceBits |
         (static_cast<uint32_t>(s) & ((1u << (bits + 8)) - 1));
}

// Returns whether all lines with both ends in a box of these positions (in voxels, closed) can be
// thin lines.
VOXELD_HD inline bool AreThin(const double lo[3], const double hi[3]) {
  double square = 0;
  for (int a = 0; a < 3; ++a) {
    if (!(lo[a] > -16383.0 && hi[a] < 16383.0)) return false;
    square += (hi[a] - lo[a]) * (hi[a] - lo[a]);
  }
  return square < (kMaxThinSteps - 8.0) * (kMaxThinSteps - 8.0);
}

// Requires: THIN or EUCLIDEAN; `word` is the word of its voxels. If N = 0, two ends in different
// voxels are drawn as the two voxels of a line with one step.
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

VOXELD_HD inline ThinTrack TrackOf(const ThinLine& line) {
  ThinTrack track;
  for (int a = 0; a < 3; ++a) {
    track.axis[a] = TrackAxis(line.s[a], line.d[a], Max(line.n, 1), a);
  }
  track.word = line.word;
  track.n = line.n;
  return track;
}

VOXELD_HD inline int32_t WrapMul(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) * static_cast<uint32_t>(b));
}
VOXELD_HD inline int32_t WrapAdd(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) + static_cast<uint32_t>(b));
}

// Rounds to the nearest whole number. Requires: |x| < 2²².
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

// Returns an estimate, at most 2 units in the last place off.
VOXELD_HD inline float Quotient(float a, float b) {
#if defined(__CUDA_ARCH__)
  return __fdividef(a, b);
#else
  return a / b;
#endif
}

// Returns the box, of 2^bits voxels on this axis, that holds voxel_k. Requires: k ≤ n.
VOXELD_HD inline int32_t BoxAt(const ThinLine& line, int a, int32_t k, int bits) {
  const int32_t m = Max(line.n, 1);
  const float at =
      static_cast<float>(line.s[a]) +
      static_cast<float>(line.d[a]) * Quotient(static_cast<float>(k), static_cast<float>(m));
  // Rounded to nearest, less a half: at most one too few or, because of the estimate, one too many.
  int32_t box = RoundNear(at / static_cast<float>(kUnitsPerVoxel << bits) - 0.5f);
  const int32_t past =
      WrapAdd(WrapMul(line.s[a] - WrapMul(box, 256 << bits), m), WrapMul(line.d[a], k));
  if (past < 0) --box;
  if (past >= m << (8 + bits)) ++box;
  return box;
}

// One axis of a walk from box to box.
struct ThinAxis {
  int32_t box;         // the box that the line is in
  int32_t next;        // the k at which it enters the next box; n + 1: never
  int32_t base;        // (S − face)·N modulo 2³²
  float gap, inverse;  // face − S; N / D

  // Computes the values for the face ahead of `box`.
  VOXELD_HD void Find(int32_t d, int32_t n) {
    const float x = gap * inverse;
    next = n + 1;
    if (!(x < static_cast<float>(n + 2))) return;  // infinite if D = 0
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
  // Enters the next box; `size`: the size of a box, in units, in that direction.
  VOXELD_HD void Cross(int32_t d, int32_t n, int32_t size) {
    box += d < 0 ? -1 : 1;
    gap += static_cast<float>(size);
    base = WrapAdd(base, -WrapMul(size, n));
    Find(d, n);
  }
};

// Goes from box to box of a grid, beginning at voxel `k` in box `at`. Calls f(box, k, end) for each
// box, with the voxels k to end − 1 in it, as long as f returns true. bits: log2 of a box's voxels,
// by axis.
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
    // Crosses one face after the other, even if several are met at one voxel, so that the
    // instructions are the same for every axis.
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

// Goes from voxel to voxel, modulo the size of a box.
struct ThinCursor {
  uint32_t at[3], step[3];

  // Starts at voxel k.
  VOXELD_HD ThinCursor(const ThinTrack& track, int32_t k) {
    for (int a = 0; a < 3; ++a) {
      const uint64_t axis = track.axis[a];
      at[a] = static_cast<uint32_t>(static_cast<uint32_t>(k) * axis >> 32) +
              (static_cast<uint32_t>(axis) << (24 - TrackBits(a))) + 1;
      step[a] = static_cast<uint32_t>(axis >> 32) + 1;
    }
  }
  VOXELD_HD uint32_t voxel(int a) const { return at[a] >> (32 - TrackBits(a)); }
  VOXELD_HD void Next() {
    for (int a = 0; a < 3; ++a) at[a] += step[a];
  }
};

}  // namespace voxeld::gpu
