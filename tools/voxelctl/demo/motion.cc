#include "tools/voxelctl/demo/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace voxeld::voxelctl {
namespace {

constexpr double kFree = 0.97;  // the outermost voxels stay free

client::Affine TurnAt(const Motion& motion, double seconds) {
  const double turns = motion.turn_s > 0 ? std::fmod(seconds / motion.turn_s, 1.0) : 0;
  return client::Affine::Rotate({0, 1, 0}, motion.tilt_degrees * std::numbers::pi / 180) *
         client::Affine::Rotate({0, 0, 1}, turns * 2 * std::numbers::pi);
}

}  // namespace

client::Affine PoseAt(const Motion& motion, const DisplaySpace& space, double seconds) {
  return client::Affine::Translate({space.center.x, space.center.y, space.center.z}) *
         TurnAt(motion, seconds);
}

std::optional<client::HalfSpace> CutAt(const Motion& motion, const DisplaySpace& space,
                                       double seconds) {
  if (!motion.cut) return std::nullopt;
  const Cut& cut = *motion.cut;
  const double share = (1 + std::cos(2 * std::numbers::pi * seconds / cut.period_s)) / 2;
  const double distance = cut.deepest + (cut.outermost - cut.deepest) * share;
  const std::array<double, 12> m = TurnAt(motion, seconds).m;
  const Point3& t = cut.toward;
  const Point3 n = {m[0] * t.x + m[1] * t.y + m[2] * t.z, m[4] * t.x + m[5] * t.y + m[6] * t.z,
                    m[8] * t.x + m[9] * t.y + m[10] * t.z};
  // The half-space is n · (p − centre) ≤ distance.
  return client::HalfSpace{
      -n.x, -n.y, -n.z,
      distance + n.x * space.center.x + n.y * space.center.y + n.z * space.center.z};
}

double FitRadius(const DisplaySpace& space, double height) {
  return kFree * std::min({space.half.x, space.half.y, space.half.z / height});
}

}  // namespace voxeld::voxelctl
