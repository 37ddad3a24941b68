// How a scene moves: by maps and planes alone, so that nothing is sent again.
#pragma once

#include <optional>

#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/scene/placement.h"
#include "voxeld/drawing.h"

namespace voxeld::voxelctl {

// A plane that comes in from one side, goes back, and comes again.
struct Cut {
  Point3 toward;         // of unit length, in the scene's own axes: what lies on this side goes
  double deepest = 0;    // where the plane turns back, along `toward` from the centre
  double outermost = 1;  // where nothing is cut
  double period_s = 10;  // there and back
};

struct Motion {
  double turn_s =
      12;  // a turn about the scene's own upright axis, counter-clockwise from above; 0: none
  double tilt_degrees = 0;  // of that axis, to the right; it stays so
  std::optional<Cut> cut;
};

// From the scene's own axes, about the origin, into the display, `seconds` after its beginning.
client::Affine PoseAt(const Motion& motion, const DisplaySpace& space, double seconds);

// What of the scene is left, turned with it; begins with all. Without a cut everything is.
std::optional<client::HalfSpace> CutAt(const Motion& motion, const DisplaySpace& space,
                                       double seconds);

// The largest radius about the upright axis at which something as high as `height` radii to either side of its middle fits,
// however it is turned about that axis.
double FitRadius(const DisplaySpace& space, double height);

}  // namespace voxeld::voxelctl
