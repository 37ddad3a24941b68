// The voxels of a line one voxel wide, restricted to a box at a cost proportional to the voxels in
// it.
//
// THIN and EUCLIDEAN: voxel_k = ⌊S + (E−S)·k/N⌋ for k = 0..N, in exact rational arithmetic; THIN
// has N = max over axes of |⌊E⌋−⌊S⌋|, EUCLIDEAN N = ⌊|E−S|⌋. Each coordinate is monotonic in k, so
// the k whose voxels lie in a box are a range, found by division.
//
// COVER: the cells crossed on the way from the lexicographically smaller end to the other,
// 6-connected. Crossing i = 1..n_a on axis a takes place at t = (p_a + 256·(i−1)) / |D_a|;
// crossings are ordered by (t, axis); the k-th cell is reached after the first k crossings, and N
// is their number. The cells in a box are those between the last entry and the first exit.
//
// N = 0 gives the voxels of S and E, in their colours.
//
// Guarantee: the voxels are the same from both ends, and a shift by whole voxels shifts them. THIN:
// 26-connected, an inner voxel has exactly two neighbours; COVER: 6-connected, every cell that the
// line crosses; EUCLIDEAN: steps of one voxel along the line.
#pragma once

#include "gpu/primitives/fixed.h"
#include "gpu/records.h"

namespace voxeld::gpu {

struct Line {
  Int3 s, e;
  uint32_t color_s = 0, color_e = 0;  // 0x00RRGGBB
  LineSampling sampling = LineSampling::kThin;
};

template <class Emit>
VOXELD_HD void EmitVoxelOf(const Int3& p, uint32_t rgb, const Box3& box, Emit&& emit) {
  const int64_t x = VoxelOf(p[0]), y = VoxelOf(p[1]), z = VoxelOf(p[2]);
  if (Contains(box, x, y, z)) {
    emit(static_cast<int32_t>(x), static_cast<int32_t>(y), static_cast<int32_t>(z), rgb);
  }
}

// Returns the number of steps of a THIN or EUCLIDEAN line.
VOXELD_HD inline int64_t LineSteps(const Line& line) {
  if (line.sampling == LineSampling::kEuclidean) {
    Wide sum = 0;
    for (int a = 0; a < 3; ++a)
      sum += static_cast<Wide>(line.e[a] - line.s[a]) * (line.e[a] - line.s[a]);
    return FloorSqrt(sum) >> 8;
  }
  int64_t n = 0;
  for (int a = 0; a < 3; ++a) n = Max(n, Abs(VoxelOf(line.e[a]) - VoxelOf(line.s[a])));
  return n;
}

// `I`: an integer type that holds 2²·|position|·N and |position|².
template <class I, class Emit>
VOXELD_HD VOXELD_DEVICE_NOINLINE void EmitSteps(const Line& line, int64_t n, const Box3& box,
                                                Emit emit) {
  const int64_t m = n * kUnitsPerVoxel;
  I k0 = 0, k1 = n + 1;
  for (int a = 0; a < 3; ++a) {
    // This coordinate is in the box if lo ≤ d·k < hi.
    const int64_t d = line.e[a] - line.s[a];
    const I base = static_cast<I>(line.s[a]) * n;
    const I lo = static_cast<I>(m) * box.lo[a] - base;
    const I hi = static_cast<I>(m) * box.hi[a] - base;
    if (d == 0) {
      if (lo > 0 || hi <= 0) return;
    } else if (d > 0) {
      if (lo > 0) k0 = Max<I>(k0, CeilDiv<I>(lo, d));
      if (hi <= static_cast<I>(d) * n) k1 = Min<I>(k1, CeilDiv<I>(hi, d));
    } else {
      if (hi <= 0) k0 = Max<I>(k0, FloorDiv<I>(-hi, -d) + 1);
      if (lo > static_cast<I>(d) * n) k1 = Min<I>(k1, FloorDiv<I>(-lo, -d) + 1);
    }
  }
  if (k0 >= k1) return;
  Stepper p[3];
  for (int a = 0; a < 3; ++a) {
    const int64_t d = line.e[a] - line.s[a];
    p[a] = Stepper::At<I>(static_cast<I>(line.s[a]) * n + static_cast<I>(d) * k0, d, m);
  }
  int64_t left = static_cast<int64_t>(k1 - k0);
  if (line.color_s == line.color_e) {
    for (; left > 0; --left, p[0].Next(), p[1].Next(), p[2].Next()) {
      emit(static_cast<int32_t>(p[0].value), static_cast<int32_t>(p[1].value),
           static_cast<int32_t>(p[2].value), line.color_s);
    }
    return;
  }
  int64_t k = static_cast<int64_t>(k0);
  for (; left > 0; --left, ++k, p[0].Next(), p[1].Next(), p[2].Next()) {
    emit(static_cast<int32_t>(p[0].value), static_cast<int32_t>(p[1].value),
         static_cast<int32_t>(p[2].value), MixColors(line.color_s, line.color_e, k, n));
  }
}

// The crossings of one axis, on the way from `from` to `to`.
struct Crossings {
  int64_t cell;       // where the line begins
  int64_t direction;  // +1 or −1
  int64_t count;
  int64_t first;   // units to the first face
  int64_t length;  // |to − from|

  VOXELD_HD static Crossings Of(int64_t from, int64_t to) {
    Crossings c;
    c.cell = VoxelOf(from);
    c.direction = to >= from ? 1 : -1;
    c.count = Abs(VoxelOf(to) - c.cell);
    c.first = to >= from ? (c.cell + 1) * kUnitsPerVoxel - from : from - c.cell * kUnitsPerVoxel;
    c.length = Abs(to - from);
    return c;
  }
  // Returns the units to face i = 1..count.
  VOXELD_HD int64_t face(int64_t i) const { return first + (i - 1) * kUnitsPerVoxel; }
};

// A crossing as a point in the order (t, axis), t = units / length.
struct CrossingTime {
  int64_t units = 0, length = 0;
  int axis = -1;  // −1: none
};

template <class I>
VOXELD_HD bool Before(const CrossingTime& a, const CrossingTime& b) {
  const I left = static_cast<I>(a.units) * b.length, right = static_cast<I>(b.units) * a.length;
  return left < right || (left == right && a.axis < b.axis);
}

// Returns how many of the crossings of `axis` come before `time`, or at it if `inclusive`.
template <class I>
VOXELD_HD int64_t CrossingsUntil(const Crossings& c, int axis, const CrossingTime& time,
                                 bool inclusive) {
  if (c.count == 0) return 0;
  const I reach = static_cast<I>(time.units) * c.length - static_cast<I>(c.first) * time.length;
  const I spacing = static_cast<I>(time.length) * kUnitsPerVoxel;
  const bool ties = axis < time.axis || (axis == time.axis && inclusive);
  const I n = ties ? FloorDiv<I>(reach, spacing) + 1 : CeilDiv<I>(reach, spacing);
  return static_cast<int64_t>(Clamp<I>(n, 0, c.count));
}

template <class I, class Emit>
VOXELD_HD VOXELD_DEVICE_NOINLINE void EmitCells(const Line& line, const Box3& box, Emit emit) {
  Crossings c[3];
  CrossingTime entry, exit;
  int64_t total = 0;
  for (int a = 0; a < 3; ++a) {
    c[a] = Crossings::Of(line.s[a], line.e[a]);
    total += c[a].count;
  }
  for (int a = 0; a < 3; ++a) {
    // After i of its crossings, begin ≤ i < end, this coordinate is in the box.
    const bool up = c[a].direction > 0;
    const int64_t begin = Max<int64_t>(0, up ? box.lo[a] - c[a].cell : c[a].cell - box.hi[a] + 1);
    const int64_t end =
        Min<int64_t>(c[a].count + 1, up ? box.hi[a] - c[a].cell : c[a].cell - box.lo[a] + 1);
    if (begin >= end) return;
    if (begin > 0) {
      const CrossingTime t{c[a].face(begin), c[a].length, a};
      if (entry.axis < 0 || Before<I>(entry, t)) entry = t;
    }
    if (end <= c[a].count) {
      const CrossingTime t{c[a].face(end), c[a].length, a};
      if (exit.axis < 0 || Before<I>(t, exit)) exit = t;
    }
  }
  if (entry.axis >= 0 && exit.axis >= 0 && !Before<I>(entry, exit)) return;

  int64_t cell[3], left[3], units[3];
  int64_t k = 0;
  for (int a = 0; a < 3; ++a) {
    const int64_t begin = entry.axis < 0 ? 0 : CrossingsUntil<I>(c[a], a, entry, true);
    const int64_t end = exit.axis < 0 ? c[a].count : CrossingsUntil<I>(c[a], a, exit, false);
    k += begin;
    left[a] = end - begin;
    cell[a] = c[a].cell + c[a].direction * begin;
    units[a] = c[a].face(begin + 1);
  }
  // x before y: units_x / length_x ≤ units_y / length_y, and so on; kept up to date by additions.
  I xy = static_cast<I>(units[0]) * c[1].length - static_cast<I>(units[1]) * c[0].length;
  I xz = static_cast<I>(units[0]) * c[2].length - static_cast<I>(units[2]) * c[0].length;
  I yz = static_cast<I>(units[1]) * c[2].length - static_cast<I>(units[2]) * c[1].length;
  const I step[3] = {static_cast<I>(c[0].length) * kUnitsPerVoxel,
                     static_cast<I>(c[1].length) * kUnitsPerVoxel,
                     static_cast<I>(c[2].length) * kUnitsPerVoxel};
  for (;; ++k) {
    emit(static_cast<int32_t>(cell[0]), static_cast<int32_t>(cell[1]),
         static_cast<int32_t>(cell[2]), MixColors(line.color_s, line.color_e, k, total));
    if (left[0] > 0 && (left[1] == 0 || xy <= 0) && (left[2] == 0 || xz <= 0)) {
      --left[0], cell[0] += c[0].direction;
      xy += step[1], xz += step[2];
    } else if (left[1] > 0 && (left[2] == 0 || yz <= 0)) {
      --left[1], cell[1] += c[1].direction;
      xy -= step[0], yz += step[2];
    } else if (left[2] > 0) {
      --left[2], cell[2] += c[2].direction;
      xz -= step[0], yz -= step[1];
    } else {
      return;
    }
  }
}

// Returns whether `p` comes before `q` in the order of (x, y, z).
VOXELD_HD inline bool LexicographicallyLess(const Int3& p, const Int3& q) {
  if (p[0] != q[0]) return p[0] < q[0];
  if (p[1] != q[1]) return p[1] < q[1];
  return p[2] < q[2];
}

// Returns the same line with its lexicographically smaller end first.
VOXELD_HD inline Line Ordered(const Line& line) {
  if (!LexicographicallyLess(line.e, line.s)) return line;
  return {line.e, line.s, line.color_e, line.color_s, line.sampling};
}

// Up to this coordinate (in units), the products for a line's voxels fit in 64 bits.
inline constexpr int64_t kNarrowLine = int64_t{1} << 28;

VOXELD_HD inline bool IsNarrow(const Line& line) {
  bool narrow = true;
  for (int a = 0; a < 3; ++a) {
    narrow &= Abs(line.s[a]) <= kNarrowLine && Abs(line.e[a]) <= kNarrowLine;
  }
  return narrow;
}

// Calls emit(x, y, z, rgb) for every voxel of `line` in `box`, possibly more than once for some.
// `narrow`: the line IsNarrow.
template <class Emit>
VOXELD_HD void EmitLine(const Line& line, const Box3& box, bool narrow, Emit&& emit) {
  if (line.sampling == LineSampling::kCover) {
    const Line ordered = Ordered(line);
    bool one_cell = true;
    for (int a = 0; a < 3; ++a) one_cell &= VoxelOf(line.s[a]) == VoxelOf(line.e[a]);
    if (!one_cell) {
      return narrow ? EmitCells<int64_t>(ordered, box, emit) : EmitCells<Wide>(ordered, box, emit);
    }
  } else if (const int64_t n = LineSteps(line); n > 0) {
    return narrow ? EmitSteps<int64_t>(line, n, box, emit) : EmitSteps<Wide>(line, n, box, emit);
  }
  EmitVoxelOf(line.s, line.color_s, box, emit);
  EmitVoxelOf(line.e, line.color_e, box, emit);
}

template <class Emit>
VOXELD_HD void EmitLine(const Line& line, const Box3& box, Emit&& emit) {
  EmitLine(line, box, IsNarrow(line), emit);
}

}  // namespace voxeld::gpu
