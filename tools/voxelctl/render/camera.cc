#include "tools/voxelctl/render/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace voxeld::voxelctl {
namespace {

using display::Vec3;

constexpr double kDistance = 3.4;  // in radii of the outline's bounding sphere
constexpr int kViewsAround = 360;
constexpr double kFill = 0.92;  // of the picture's width or height

double Dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

}  // namespace

void Camera::Turn(double azimuth_degrees, double elevation_degrees) {
  const double azimuth = azimuth_degrees * std::numbers::pi / 180;
  const double elevation = elevation_degrees * std::numbers::pi / 180;
  const double ca = std::cos(azimuth), sa = std::sin(azimuth);
  const double ce = std::cos(elevation), se = std::sin(elevation);
  right_ = {ca, sa, 0};
  away_ = {-sa * ce, ca * ce, -se};
  up_ = {-sa * se, ca * se, ce};
}

Camera::Camera(const ViewAngles& angles, std::span<const Vec3> outline, int width, int height,
               bool around) {
  Vec3 low = outline.front(), high = outline.front();
  for (const Vec3& p : outline) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  center_ = {(low.x + high.x) / 2, (low.y + high.y) / 2, (low.z + high.z) / 2};
  radius_ = 1e-6;
  for (const Vec3& p : outline) {
    radius_ = std::max(radius_, std::hypot(p.x - center_.x, p.y - center_.y, p.z - center_.z));
  }
  distance_ = radius_ * kDistance;

  double x0 = HUGE_VAL, x1 = -HUGE_VAL, y0 = HUGE_VAL, y1 = -HUGE_VAL;
  const int views = around ? kViewsAround : 1;
  for (int view = 0; view < views; ++view) {
    Turn(around ? 360.0 * view / views : angles.azimuth_degrees, angles.elevation_degrees);
    for (const Vec3& p : outline) {
      const Vec3 c = ToCamera(p);
      x0 = std::min(x0, c.x / c.z);
      x1 = std::max(x1, c.x / c.z);
      y0 = std::min(y0, c.y / c.z);
      y1 = std::max(y1, c.y / c.z);
    }
  }
  if (around) {
    x1 = std::max(x1, -x0);
    x0 = -x1;
    Turn(angles.azimuth_degrees, angles.elevation_degrees);
  }
  focal_ = kFill * std::min(width / std::max(x1 - x0, 1e-9), height / std::max(y1 - y0, 1e-9));
  middle_x_ = width / 2.0 - focal_ * (x0 + x1) / 2;
  middle_y_ = height / 2.0 + focal_ * (y0 + y1) / 2;
}

Vec3 Camera::Rotate(const Vec3& d) const { return {Dot(d, right_), Dot(d, up_), Dot(d, away_)}; }

Vec3 Camera::ToCamera(const Vec3& p) const {
  Vec3 c = Rotate({p.x - center_.x, p.y - center_.y, p.z - center_.z});
  c.z += distance_;
  return c;
}

}  // namespace voxeld::voxelctl
