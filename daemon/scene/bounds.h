// Axis-aligned boxes in double precision, for range checks: conservative, never for what is drawn.
#pragma once

#include <string>

#include "gpu/affine.h"

namespace voxeld::daemon {

// Empty when made.
struct Bounds {
  double min[3] = {0, 0, 0};
  double max[3] = {0, 0, 0};
  bool empty = true;

  void Include(const Bounds& other);
  bool operator==(const Bounds&) const = default;
};

// A box around the image of `box`. Not finite if a corner's is not.
Bounds MapBounds(const gpu::Affine& map, const Bounds& box);

// The coordinate of greatest magnitude; infinity if one is not finite; 0 if empty.
double LargestMagnitude(const Bounds& box);

bool IsFinite(const gpu::Affine& map);

// True if the linear part has no usable inverse: its determinant is not finite, or below 10⁻¹² of
// the product of its rows' lengths (which stretching alone never brings about).
bool IsSingular(const gpu::Affine& map);

// "determinant 0 of [1 0 0; 0 1 0; 0 0 0]", for messages.
std::string DescribeLinear(const gpu::Affine& map);

}  // namespace voxeld::daemon
