// Axis-aligned boxes in double precision for range checks. They are conservative and never used for
// drawing.
#pragma once

#include <string>

#include "gpu/affine.h"

namespace voxeld::daemon {

// A new box is empty.
struct Bounds {
  double min[3] = {0, 0, 0};
  double max[3] = {0, 0, 0};
  bool empty = true;

  void Include(const Bounds& other);
  bool operator==(const Bounds&) const = default;
};

// Returns: a box around the image of `box`. Not finite if a corner's image is not.
Bounds MapBounds(const gpu::Affine& map, const Bounds& box);

// Returns: the greatest absolute coordinate; infinity if one is not finite; 0 if the box is empty.
double LargestMagnitude(const Bounds& box);

bool IsFinite(const gpu::Affine& map);

// Returns: whether the linear part has no usable inverse: its determinant is not finite, or below
// 10⁻¹² of the product of its rows' lengths (which scaling alone never causes).
bool IsSingular(const gpu::Affine& map);

// Returns: text such as "determinant 0 of [1 0 0; 0 1 0; 0 0 0]", for messages.
std::string DescribeLinear(const gpu::Affine& map);

}  // namespace voxeld::daemon
