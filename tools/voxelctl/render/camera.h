// The camera for a picture of a display. Input is in millimetres, output in picture elements.
#pragma once

#include <span>

#include "display/api/geometry.h"

namespace voxeld::voxelctl {

struct ViewAngles {
  // At 0 the viewer is in front (towards −y), and moves to the right, counter-clockwise seen from
  // above.
  double azimuth_degrees = 24;
  double elevation_degrees = 20;  // above the horizon, −89 to 89
};

// A pinhole camera. In camera space x points to the right, y up, and z away from the viewer.
class Camera {
 public:
  // Looks at the centre of `outline` from a distance in proportion to its size, close enough to
  // show depth, and fits all of it into width·height elements with a margin. With `around`, it fits
  // everything that is visible from any side at this elevation, so that the size is constant while
  // the camera moves around. Requires: `outline` is not empty.
  Camera(const ViewAngles& angles, std::span<const display::Vec3> outline, int width, int height,
         bool around = false);

  display::Vec3 ToCamera(const display::Vec3& point) const;
  display::Vec3 Rotate(const display::Vec3& direction) const;

  // Return elements from the picture's left and top edge for a point in camera space. Requires: z >
  // 0.
  double ScreenX(const display::Vec3& p) const { return middle_x_ + focal_ * p.x / p.z; }
  double ScreenY(const display::Vec3& p) const { return middle_y_ - focal_ * p.y / p.z; }
  double focal() const { return focal_; }

  // Returns 0 at the nearest point of the outline's bounding sphere, 1 at its farthest.
  double Depth(const display::Vec3& p) const { return (p.z - distance_ + radius_) / (2 * radius_); }

 private:
  void Turn(double azimuth_degrees, double elevation_degrees);

  display::Vec3 right_, up_, away_, center_;
  double distance_ = 1, radius_ = 1, focal_ = 1, middle_x_ = 0, middle_y_ = 0;
};

}  // namespace voxeld::voxelctl
