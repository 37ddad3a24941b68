// A box: max |q| ≤ 1.
#pragma once

#include "gpu/primitives/solid_voxels.h"

namespace voxeld::gpu {

struct Box : SolidPrimitive<Box> {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kBox;

  VOXELD_HD static Affine CanonicalMap(const GeometryRecord& g) {
    const float* p = g.params;
    return CentreAndHalves(p, p[3] / 2.0, p[4] / 2.0, p[5] / 2.0);
  }

  VOXELD_HD static bool Contains(const float q[3]) {
    return Abs(q[0]) <= 1 && Abs(q[1]) <= 1 && Abs(q[2]) <= 1;
  }
};

}  // namespace voxeld::gpu
