// Where a layer is drawn: its clip planes and its region (gpu/delta.h), as half-spaces of voxel
// space in whole numbers, and its clip cylinders in double precision, so that every machine decides
// the same for each voxel.
//
// Definition. A voxel (x, y, z) belongs to the layer if for each half-space
//
//   normal · (2x+1, 2y+1, 2z+1) + offset ≥ 0          in integers, exactly
//
// that is, if its centre, in half voxels, is on the inner side of the plane or on it. A plane of
// scene space becomes a half-space of the view's voxel space in double precision, with the
// operations in the order that clip.cc writes. It is rounded once, after a scaling by a power of
// two that puts the greatest component of its normal into [2³⁷, 2³⁸). A region is six planes; its
// faces are inside.
//
// Error. In a grid of nx × ny × nz voxels, rounding shifts a plane, measured along the axis nearest
// to its normal, by at most (nx + ny + nz + 1) · 2⁻³⁸ voxel: 2⁻²² in the greatest possible grid.
// The double precision before that adds as much as it adds to vertices: 2⁻⁵⁰ of the terms that are
// summed.
//
// A cylinder holds a voxel if q₀² + q₁² ≤ 1 for
//
//   qᵣ = ((row₀·(2x+1) + row₁·(2y+1)) + row₂·(2z+1)) + base     in IEEE double, each operation rounded
//
// Rounding keeps order: the least and the greatest computed q of a box of voxels are found at its
// corners.
//
// A plane and its opposite are rounded to exact opposites: each voxel is in at least one of them,
// and in both only if its centre lies in the rounded plane.
#pragma once

#include <cstdint>

#include "gpu/primitives/fixed.h"
#include "gpu/records.h"

namespace voxeld::gpu {

struct VoxelHalfSpace {
  int64_t normal[3] = {};  // at most 2³⁸ each way
  int64_t offset = 0;      // at most 2⁶¹ each way
  bool operator==(const VoxelHalfSpace&) const = default;
};

inline constexpr int64_t kMaxClipNormal = int64_t{1} << 38;
inline constexpr int64_t kMaxClipOffset = int64_t{1} << 61;

// A half-space that no voxel is in. Under a view without an inverse, a layer with clips shows
// nothing.
VOXELD_HD inline VoxelHalfSpace NowhereInside() { return {{0, 0, 0}, -1}; }

// Requires: coordinates of a grid's voxels, 0 to 2¹⁸, so that nothing overflows.
VOXELD_HD inline int64_t ClipValue(const VoxelHalfSpace& h, int64_t x, int64_t y, int64_t z) {
  return h.normal[0] * (2 * x + 1) + h.normal[1] * (2 * y + 1) + h.normal[2] * (2 * z + 1) +
         h.offset;
}

VOXELD_HD inline bool IsInside(const VoxelHalfSpace& h, int64_t x, int64_t y, int64_t z) {
  return ClipValue(h, x, y, z) >= 0;
}

enum class ClipSide : uint8_t { kInside, kCut, kOutside };

// Returns the side on which all voxels of a box are. Requires: the box is not empty.
VOXELD_HD inline ClipSide SideOf(const VoxelHalfSpace& h, const Box3& box) {
  int64_t least = h.offset, greatest = h.offset;
  for (int a = 0; a < 3; ++a) {
    const int64_t first = h.normal[a] * (2 * static_cast<int64_t>(box.lo[a]) + 1);
    const int64_t last = h.normal[a] * (2 * static_cast<int64_t>(box.hi[a]) - 1);
    least += Min(first, last);
    greatest += Max(first, last);
  }
  return least >= 0 ? ClipSide::kInside : greatest < 0 ? ClipSide::kOutside : ClipSide::kCut;
}

struct VoxelCylinder {
  struct Row {
    double by[3] = {}, base = 0;  // of half voxels
    bool operator==(const Row&) const = default;
  };
  Row rows[2];
  bool operator==(const VoxelCylinder&) const = default;
};

VOXELD_HD inline bool IsInside(const VoxelCylinder& c, int64_t x, int64_t y, int64_t z) {
  double square[2];
  for (int r = 0; r < 2; ++r) {
    const VoxelCylinder::Row& row = c.rows[r];
    const double q =
        ((row.by[0] * static_cast<double>(2 * x + 1) + row.by[1] * static_cast<double>(2 * y + 1)) +
         row.by[2] * static_cast<double>(2 * z + 1)) +
        row.base;
    square[r] = q * q;
  }
  return square[0] + square[1] <= 1;
}

VOXELD_HD inline ClipSide SideOf(const VoxelCylinder& c, const Box3& box) {
  double nearest[2], farthest[2];  // squares
  for (int r = 0; r < 2; ++r) {
    const VoxelCylinder::Row& row = c.rows[r];
    double low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      const double first = row.by[a] * static_cast<double>(2 * static_cast<int64_t>(box.lo[a]) + 1);
      const double last = row.by[a] * static_cast<double>(2 * static_cast<int64_t>(box.hi[a]) - 1);
      low[a] = Min(first, last);
      high[a] = Max(first, last);
    }
    const double least = ((low[0] + low[1]) + low[2]) + row.base;
    const double greatest = ((high[0] + high[1]) + high[2]) + row.base;
    farthest[r] = Max(least * least, greatest * greatest);
    nearest[r] = least <= 0 && greatest >= 0 ? 0 : Min(least * least, greatest * greatest);
  }
  if (farthest[0] + farthest[1] <= 1) return ClipSide::kInside;
  return nearest[0] + nearest[1] <= 1 ? ClipSide::kCut : ClipSide::kOutside;
}

// The planes and the region's six faces.
inline constexpr uint32_t kMaxHalfSpaces = kMaxClipPlanes + 6;

// All clips of a layer, under one view. A layer without any is drawn everywhere.
struct VoxelClip {
  uint32_t count = 0;
  VoxelHalfSpace half_spaces[kMaxHalfSpaces];
  uint32_t cylinder_count = 0;
  VoxelCylinder cylinders[kMaxClipCylinders];
};

// `view` maps the scene to voxel space. Host only.
VoxelClip MapClip(const LayerRecord& layer, const Affine& view);

}  // namespace voxeld::gpu
