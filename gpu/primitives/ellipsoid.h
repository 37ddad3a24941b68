// An ellipsoid along the axes: √((x/a)² + (y/b)² + (z/c)²) = 1.
//
// Guarantee: P / |∇P| is the distance to first order: inside, a shell of half-width h is thinner by
// up to h²/2ρ, where ρ is the least radius of curvature; otherwise as in gpu/implicit/field.h.
#pragma once

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Ellipsoid {
  implicit::Vector center, radii;  // each > 0

  implicit::FieldShape Make(implicit::Graph& g) const {
    implicit::Node q[3];
    for (int a = 0; a < 3; ++a) {
      q[a] = g.Div(g.Sub(g.Axis(a), g.Constant(center[a])), implicit::AtLeastAVoxel(g, radii[a]));
    }
    return {g.Sub(g.Length(q), g.Constant(1)), -1, center - radii, center + radii};
  }
};

}  // namespace voxeld::gpu
