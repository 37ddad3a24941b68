// Points without thickness, within a bounded space: the same voxels as points.h's in 32-bit
// arithmetic.
//
// A coordinate times 256, plus a half, is rounded once, as in Snap, and is then below 2³⁰: its
// floor fits in 32 bits in either direction.
#pragma once

#include <cstdint>

#include "gpu/primitives/points.h"

namespace voxeld::gpu {

// The greatest distance, in voxels, of positions from the origin.
inline constexpr double kMostNear = 1048576.0;

// Returns whether the functions below are valid for all points in a box of these positions (in
// voxels, closed).
VOXELD_HD inline bool AreNear(const double lo[3], const double hi[3]) {
  for (int a = 0; a < 3; ++a) {
    if (!(lo[a] > -kMostNear && hi[a] < kMostNear)) return false;
  }
  return true;
}

// Returns VoxelOf(Snap(at)).
VOXELD_HD inline int32_t VoxelNear(double at) {
  const double units = at * 256.0 + 0.5;
#if defined(__CUDA_ARCH__)
  return __double2int_rd(units) >> 8;
#else
  return static_cast<int32_t>(FloorToInt(units)) >> 8;
#endif
}

// Computes the voxel of a position (of Source::positions).
VOXELD_HD inline void VoxelOfPoint(const Affine& map, const float position[3], int32_t voxel[3]) {
  const Point3d at = Map(map, static_cast<double>(position[0]), static_cast<double>(position[1]),
                         static_cast<double>(position[2]));
  voxel[0] = VoxelNear(at.x);
  voxel[1] = VoxelNear(at.y);
  voxel[2] = VoxelNear(at.z);
}

}  // namespace voxeld::gpu
