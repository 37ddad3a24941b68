// The canonical coordinates of solids: box, sphere and cylinder share them.
//
// q = inverse linear part · (voxel centre − origin), in IEEE single, in the order written here. The
// origin is snapped to a unit and split into whole voxels and a remainder, so a shift by whole
// voxels shifts the shape. The inverse is computed in double and rounded once. A row of it with a
// greatest component beyond kMaxRow is scaled down to it, so that a shape thinner than a voxel is
// drawn one voxel thick. (A voxel's step is then a little less than the shape's thickness of 2,
// which leaves a margin for the rounding of q.)
//
// A voxel is inside if it lies in `bounds` (a little larger than the shape's, in double; part of
// the definition) and q passes the shape's test. If that does not include the voxel of the origin
// (the shape misses every centre around it), that voxel is covered too.
//
// Guarantee: a solid covers the voxels whose centres are inside the shape, to within 2·10⁻⁵ of its
// half axes, and its volume is right within 1 % at a radius of 20 voxels; a shape thinner than a
// voxel is one voxel thick. A shift by whole voxels shifts it. With a shell or a colour scale it is
// drawn as in gpu/implicit/field.h: the same solid, and a surface that is nowhere more than a voxel
// from the plain one.
#pragma once

#include "gpu/affine.h"
#include "gpu/primitives/fixed.h"

namespace voxeld::gpu {

struct Solid {
  static constexpr double kMaxRow = 2.0 - 0.0009765625;

  int64_t origin[3] = {};  // voxel
  int64_t rest[3] = {};    // 0 to 255 units
  float inverse[3][3] = {};
  Box3 bounds;
  bool drawable = false;  // false: no inverse, nothing is drawn

  // `map`: canonical coordinates (each −1 to 1) → voxel space. `keep_thin`: scale rows down to
  // kMaxRow.
  VOXELD_HD static Solid Of(const Affine& map, bool keep_thin = true) {
    Solid s;
    const double* m = map.m;
    const double cofactor[3][3] = {
        {m[5] * m[10] - m[6] * m[9], m[2] * m[9] - m[1] * m[10], m[1] * m[6] - m[2] * m[5]},
        {m[6] * m[8] - m[4] * m[10], m[0] * m[10] - m[2] * m[8], m[2] * m[4] - m[0] * m[6]},
        {m[4] * m[9] - m[5] * m[8], m[1] * m[8] - m[0] * m[9], m[0] * m[5] - m[1] * m[4]}};
    const double det = (m[0] * cofactor[0][0] + m[1] * cofactor[1][0]) + m[2] * cofactor[2][0];
    constexpr double kHuge = 1e300;
    double reach[3] = {};  // of the shape from its origin, voxels
    double scales[3];
    for (int r = 0; r < 3; ++r) {
      double row[3], greatest = 0;
      for (int c = 0; c < 3; ++c) {
        row[c] = cofactor[r][c] / det;
        if (!(Abs(row[c]) < kHuge) || !(Abs(m[c * 4 + r]) < kHuge)) return s;
        greatest = Max(greatest, Abs(row[c]));
      }
      const double scale = keep_thin && greatest > kMaxRow ? kMaxRow / greatest : 1.0;
      scales[r] = scale;
      for (int c = 0; c < 3; ++c) {
        s.inverse[r][c] = static_cast<float>(row[c] * scale);
        reach[c] = reach[c] + Abs(m[c * 4 + r]) / scale;
      }
    }
    // The error of canonical coordinates in single precision at that distance, and its size in
    // voxels.
    constexpr double kRounding = 2.5e-7;
    double spare[3] = {};
    for (int r = 0; r < 3; ++r) {
      double off = 0;
      for (int c = 0; c < 3; ++c) off = off + Abs(static_cast<double>(s.inverse[r][c])) * reach[c];
      for (int c = 0; c < 3; ++c)
        spare[c] = spare[c] + Abs(m[c * 4 + r]) / scales[r] * (off * kRounding);
    }
    for (int a = 0; a < 3; ++a) {
      const int64_t units = Snap(m[a * 4 + 3]);
      s.origin[a] = VoxelOf(units);
      s.rest[a] = units - s.origin[a] * kUnitsPerVoxel;
      // The centre of a voxel inside is at most that far from the origin, and the origin is less
      // than half a voxel from the centre of its own voxel.
      const double far = reach[a] + spare[a] + 0.5625;
      const int64_t size = far < 1073741824.0 ? FloorToInt(far) : 1 << 30;
      s.bounds.lo[a] = ToVoxel32(s.origin[a] - size);
      s.bounds.hi[a] = ToVoxel32(s.origin[a] + size + 1);
    }
    s.drawable = true;
    return s;
  }

  // Returns the distance of a voxel's centre from the origin along one axis, in voxels.
  VOXELD_HD float Distance(int axis, int64_t voxel) const {
    return static_cast<float>((voxel - origin[axis]) * kUnitsPerVoxel + kHalfVoxel - rest[axis]) *
           0.00390625f;
  }

  VOXELD_HD void Canonical(float dx, float dy, float dz, float q[3]) const {
    for (int r = 0; r < 3; ++r) {
      q[r] = (inverse[r][0] * dx + inverse[r][1] * dy) + inverse[r][2] * dz;
    }
  }
};

// Returns whether a voxel is inside. `Shape::Contains(q)` tests canonical coordinates.
template <class Shape>
VOXELD_HD bool IsInside(const Solid& s, int64_t x, int64_t y, int64_t z) {
  if (!Contains(s.bounds, x, y, z)) return false;
  float q[3];
  s.Canonical(s.Distance(0, x), s.Distance(1, y), s.Distance(2, z), q);
  return Shape::Contains(q);
}

}  // namespace voxeld::gpu
