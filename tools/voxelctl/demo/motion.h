// The motion of a scene, by maps and planes alone, so nothing is sent again.
#pragma once

#include <optional>

#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/scene/placement.h"
#include "voxeld/drawing.h"

namespace voxeld::voxelctl {

// A plane that moves in from one side, returns, and repeats.
struct Cut {
  Point3 toward;         // unit vector in the scene's own axes: this side is removed
  double deepest = 0;    // where the plane turns back, along `toward` from the centre
  double outermost = 1;  // where nothing is removed
  double period_s = 10;  // one way and back
};

struct Motion {
  double turn_s =
      12;  // per turn about the scene's own upright axis, counter-clockwise from above; 0: none
  double tilt_degrees = 0;  // of that axis, to the right; constant
  std::optional<Cut> cut;
};

// Returns the map from the scene's own axes, about the origin, into the display, `seconds` after
// the beginning.
client::Affine PoseAt(const Motion& motion, const DisplaySpace& space, double seconds);

// Returns the half-space that is kept, rotated with the scene; nothing is removed at the beginning.
// Without a cut the result is empty and everything is kept.
std::optional<client::HalfSpace> CutAt(const Motion& motion, const DisplaySpace& space,
                                       double seconds);

// Returns the largest radius about the upright axis at which an object that extends `height` radii
// to either side of its middle fits, at any rotation about that axis.
double FitRadius(const DisplaySpace& space, double height);

}  // namespace voxeld::voxelctl
