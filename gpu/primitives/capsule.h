// Thick points and lines: all voxels whose centre lies within a radius of a (closed) segment, in
// voxel space.
//
// Evaluated in IEEE double, in the order written here, relative to the voxel that holds the
// lexicographically smaller end: the result is the same from both ends, and a shift by whole voxels
// shifts it. Positions are in units; up to 2²⁶ they and their squares are exact.
//
// Guarantee: a thick point or line covers exactly the voxels whose centres lie within half the
// thickness, in double precision; ends and joints are round.
#pragma once

#include "gpu/primitives/fixed.h"
#include "gpu/primitives/line.h"

namespace voxeld::gpu {

// Returns whether a point, at `w` from the start of a segment, lies within `r` of the segment.
// `axis`: the segment's end minus its start; `length2`: |axis|².
VOXELD_HD inline bool IsNearSegment(const double w[3], const double axis[3], double length2,
                                    double r) {
  const double dot = (w[0] * axis[0] + w[1] * axis[1]) + w[2] * axis[2];
  if (dot <= 0) return (w[0] * w[0] + w[1] * w[1]) + w[2] * w[2] <= r * r;
  if (dot >= length2) {
    const double u0 = w[0] - axis[0], u1 = w[1] - axis[1], u2 = w[2] - axis[2];
    return (u0 * u0 + u1 * u1) + u2 * u2 <= r * r;
  }
  const double c0 = w[1] * axis[2] - w[2] * axis[1];
  const double c1 = w[2] * axis[0] - w[0] * axis[2];
  const double c2 = w[0] * axis[1] - w[1] * axis[0];
  return (c0 * c0 + c1 * c1) + c2 * c2 <= r * r * length2;
}

struct Capsule {
  int64_t origin[3];  // voxel
  double start[3];    // of the axis, from the origin's corner, units
  double axis[3];     // end − start
  double length2;     // |axis|²
  double radius;      // units, a whole number
  uint32_t color_start, color_end;

  // Requires: `radius` is in units, at least 1.
  VOXELD_HD static Capsule Of(const Line& line, int64_t radius) {
    const Line ordered = Ordered(line);
    Capsule c;
    for (int a = 0; a < 3; ++a) {
      c.origin[a] = VoxelOf(ordered.s[a]);
      c.start[a] = static_cast<double>(ordered.s[a] - c.origin[a] * kUnitsPerVoxel);
      c.axis[a] = static_cast<double>(ordered.e[a] - ordered.s[a]);
    }
    c.length2 = (c.axis[0] * c.axis[0] + c.axis[1] * c.axis[1]) + c.axis[2] * c.axis[2];
    c.radius = static_cast<double>(radius);
    c.color_start = ordered.color_s;
    c.color_end = ordered.color_e;
    return c;
  }

  // Computes the vector from the start of the axis to the point `units` beyond the lower corner of
  // voxel (x, y, z).
  VOXELD_HD void Offset(int64_t x, int64_t y, int64_t z, int64_t units, double w[3]) const {
    const int64_t p[3] = {x, y, z};
    for (int a = 0; a < 3; ++a) {
      w[a] = static_cast<double>((p[a] - origin[a]) * kUnitsPerVoxel + units) - start[a];
    }
  }

  // Returns whether the point at offset `w` lies within `r` of the axis.
  VOXELD_HD bool Within(const double w[3], double r) const {
    return IsNearSegment(w, axis, length2, r);
  }

  VOXELD_HD bool Covers(int64_t x, int64_t y, int64_t z) const {
    double w[3];
    Offset(x, y, z, kHalfVoxel, w);
    return Within(w, radius);
  }

  // Returns the colour at the nearest parameter on the axis, in steps of 2⁻¹⁶.
  VOXELD_HD uint32_t ColorAt(int64_t x, int64_t y, int64_t z) const {
    if (color_start == color_end) return color_start;
    constexpr int64_t kSteps = 65536;
    double w[3];
    Offset(x, y, z, kHalfVoxel, w);
    const double dot = (w[0] * axis[0] + w[1] * axis[1]) + w[2] * axis[2];
    if (dot <= 0) return color_start;
    if (dot >= length2) return color_end;
    return MixColors(color_start, color_end, FloorToInt(dot / length2 * 65536.0), kSteps);
  }

  // Returns a box that holds every covered voxel.
  VOXELD_HD Box3 Bounds() const {
    Box3 b;
    for (int a = 0; a < 3; ++a) {
      const double low = start[a] + Min(axis[a], 0.0) - radius;
      const double high = start[a] + Max(axis[a], 0.0) + radius;
      b.lo[a] = ToVoxel32(origin[a] + FloorToInt(low / 256.0) - 1);
      b.hi[a] = ToVoxel32(origin[a] + FloorToInt(high / 256.0) + 2);
    }
    return b;
  }
};

template <class Emit>
VOXELD_HD VOXELD_DEVICE_NOINLINE void EmitCapsule(const Capsule& capsule, const Box3& box,
                                                  Emit emit) {
  // Skips blocks of 4³ voxels whose middle is farther from the axis than any of their centres can
  // be from their middle: 1.5·√3 voxels and a margin.
  constexpr int32_t kBlock = 4;
  constexpr double kReach = 720;
  const Box3 b = Intersect(box, capsule.Bounds());
  for (int32_t z0 = b.lo[2]; z0 < b.hi[2]; z0 += kBlock) {
    for (int32_t y0 = b.lo[1]; y0 < b.hi[1]; y0 += kBlock) {
      for (int32_t x0 = b.lo[0]; x0 < b.hi[0]; x0 += kBlock) {
        double w[3];
        capsule.Offset(x0, y0, z0, kBlock / 2 * kUnitsPerVoxel, w);
        if (!capsule.Within(w, capsule.radius + kReach)) continue;
        const int32_t x1 = Min(b.hi[0], x0 + kBlock);
        const int32_t y1 = Min(b.hi[1], y0 + kBlock);
        const int32_t z1 = Min(b.hi[2], z0 + kBlock);
        for (int32_t z = z0; z < z1; ++z) {
          for (int32_t y = y0; y < y1; ++y) {
            for (int32_t x = x0; x < x1; ++x) {
              if (capsule.Covers(x, y, z)) emit(x, y, z, capsule.ColorAt(x, y, z));
            }
          }
        }
      }
    }
  }
}

}  // namespace voxeld::gpu
