// Where a picture of a display is taken from. Millimetres in, picture elements out.
#pragma once

#include <span>

#include "display/api/geometry.h"

namespace voxeld::voxelctl {

struct ViewAngles {
  // The viewer stands in front (towards −y) at 0 and walks to the right,
  // counter-clockwise seen from above.
  double azimuth_degrees = 24;
  double elevation_degrees = 20;  // above the horizon, −89 to 89
};

// A pinhole. Camera space: x to the right, y up, z away from the viewer.
class Camera {
 public:
  // Looks at the middle of `outline` from a distance in proportion to its size,
  // so near that depth can be told, and frames all of it in width·height elements
  // with a margin: all that can be seen at this elevation from any side where it is
  // to walk `around`, so that nothing grows and shrinks. `outline` is not empty.
  Camera(const ViewAngles& angles, std::span<const display::Vec3> outline, int width, int height,
         bool around = false);

  display::Vec3 ToCamera(const display::Vec3& point) const;
  display::Vec3 Rotate(const display::Vec3& direction) const;

  // Elements from the picture's left and top edge, of a point in camera space; z must be > 0.
  double ScreenX(const display::Vec3& p) const { return middle_x_ + focal_ * p.x / p.z; }
  double ScreenY(const display::Vec3& p) const { return middle_y_ - focal_ * p.y / p.z; }
  double focal() const { return focal_; }

  // 0 at the nearest that the outline's sphere reaches, 1 at its farthest.
  double Depth(const display::Vec3& p) const { return (p.z - distance_ + radius_) / (2 * radius_); }

 private:
  void Turn(double azimuth_degrees, double elevation_degrees);

  display::Vec3 right_, up_, away_, center_;
  double distance_ = 1, radius_ = 1, focal_ = 1, middle_x_ = 0, middle_y_ = 0;
};

}  // namespace voxeld::voxelctl
