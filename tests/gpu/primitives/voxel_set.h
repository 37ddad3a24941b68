// Sets of voxels, and paths around them, for tests of primitives.
#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <utility>
#include <vector>

#include "gpu/primitives/fixed.h"

namespace voxeld::gpu {

using Voxel = std::array<int32_t, 3>;
using VoxelSet = std::set<Voxel>;

// Returns an emit function that collects voxels.
inline auto Into(VoxelSet& set) {
  return [&set](int32_t x, int32_t y, int32_t z, uint32_t) { set.insert({x, y, z}); };
}

inline Box3 Cube(int32_t low, int32_t high) { return {{low, low, low}, {high, high, high}}; }

inline VoxelSet Shifted(const VoxelSet& set, const Voxel& by) {
  VoxelSet result;
  for (const Voxel& v : set) result.insert({v[0] + by[0], v[1] + by[1], v[2] + by[2]});
  return result;
}

// Returns the steps to the neighbours that share a face, also those that share an edge, or also
// those that share a corner: 6, 18 or 26.
inline std::vector<Voxel> Neighbours(int count) {
  const int reach = count == 6 ? 1 : count == 18 ? 2 : 3;
  std::vector<Voxel> steps;
  for (int32_t dz = -1; dz <= 1; ++dz) {
    for (int32_t dy = -1; dy <= 1; ++dy) {
      for (int32_t dx = -1; dx <= 1; ++dx) {
        const int distance = std::abs(dx) + std::abs(dy) + std::abs(dz);
        if (distance > 0 && distance <= reach) steps.push_back({dx, dy, dz});
      }
    }
  }
  return steps;
}

// Returns whether a path of steps between free voxels of `box` leads from one to the other.
inline bool Connected(const VoxelSet& walls, const Box3& box, const Voxel& from, const Voxel& to,
                      int neighbours) {
  const int32_t nx = box.hi[0] - box.lo[0], ny = box.hi[1] - box.lo[1], nz = box.hi[2] - box.lo[2];
  const auto index = [&](const Voxel& v) {
    return static_cast<size_t>(((v[2] - box.lo[2]) * ny + v[1] - box.lo[1]) * nx + v[0] -
                               box.lo[0]);
  };
  std::vector<uint8_t> closed(static_cast<size_t>(nx * ny * nz));  // a wall, or already visited
  for (const Voxel& v : walls) closed[index(v)] = 1;
  std::vector<Voxel> next = {from};
  closed[index(from)] = 1;
  const std::vector<Voxel> steps = Neighbours(neighbours);
  while (!next.empty()) {
    const Voxel v = next.back();
    next.pop_back();
    if (v == to) return true;
    for (const Voxel& s : steps) {
      const Voxel w = {v[0] + s[0], v[1] + s[1], v[2] + s[2]};
      if (!Contains(box, w[0], w[1], w[2]) || std::exchange(closed[index(w)], 1) != 0) continue;
      next.push_back(w);
    }
  }
  return false;
}

}  // namespace voxeld::gpu
