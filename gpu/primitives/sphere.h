// A sphere, under a transform an ellipsoid: q·q ≤ 1.
#pragma once

#include "gpu/primitives/solid_voxels.h"

namespace voxeld::gpu {

struct Sphere : SolidPrimitive<Sphere> {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kSphere;

  VOXELD_HD static Affine CanonicalMap(const GeometryRecord& g) {
    const float* p = g.params;
    return CentreAndHalves(p, p[3], p[3], p[3]);
  }

  VOXELD_HD static bool Contains(const float q[3]) {
    return (q[0] * q[0] + q[1] * q[1]) + q[2] * q[2] <= 1;
  }
};

}  // namespace voxeld::gpu
