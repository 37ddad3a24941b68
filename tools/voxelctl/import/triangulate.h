// Splits polygons into triangles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// Splits polygons into triangles that keep the winding: fans for convex ones, ear clipping for
// others, which may be slightly non-planar. Not thread-safe.
class Triangulator {
 public:
  // Appends n − 2 triangles, as indices into `corners`. Requires: at least 3 corners. A polygon
  // becomes a fan if it crosses itself, if it is not convex and has over 512 corners, or if the
  // budget of tests for ears is spent.
  void Append(std::span<const Point3> corners, std::vector<uint32_t>* triangles);

 private:
  uint64_t budget_ = uint64_t{1} << 30;  // tests of a point against a triangle, for all polygons
};

}  // namespace voxeld::voxelctl
