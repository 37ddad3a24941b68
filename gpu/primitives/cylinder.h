// A cylinder along its own z: qx² + qy² ≤ 1 and |qz| ≤ 1.
#pragma once

#include "gpu/primitives/solid_voxels.h"

namespace voxeld::gpu {

struct Cylinder : SolidPrimitive<Cylinder> {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kCylinder;

  VOXELD_HD static Affine CanonicalMap(const GeometryRecord& g) {
    const float* p = g.params;
    return CentreAndHalves(p, p[3], p[3], p[4] / 2.0);
  }

  VOXELD_HD static bool Contains(const float q[3]) {
    return q[0] * q[0] + q[1] * q[1] <= 1 && Abs(q[2]) <= 1;
  }
};

}  // namespace voxeld::gpu
