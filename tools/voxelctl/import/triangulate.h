// Polygons as triangles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// Cuts polygons into triangles that keep the winding: fans of convex ones, ears of others, which need not be quite plane. Not
// thread-safe.
class Triangulator {
 public:
  // Appends n − 2 triangles, as indices into `corners`, which are at least 3. What crosses itself, has over 512 corners and is not
  // convex, or comes after the budget of tests for ears is spent, becomes a fan.
  void Append(std::span<const Point3> corners, std::vector<uint32_t>* triangles);

 private:
  uint64_t budget_ = uint64_t{1} << 30;  // tests of a point against a triangle, for all polygons
};

}  // namespace voxeld::voxelctl
