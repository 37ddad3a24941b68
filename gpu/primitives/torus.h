// A torus around its own z axis: P is the distance from the circle of `radius` in the plane through
// its centre, minus the tube's radius.
#pragma once

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Torus {
  implicit::Vector center;
  double radius = 1, tube_radius = 0.25;

  implicit::FieldShape Make(implicit::Graph& g) const {
    const implicit::Node x = g.Sub(g.Axis(0), g.Constant(center.x)),
                         y = g.Sub(g.Axis(1), g.Constant(center.y)),
                         z = g.Sub(g.Axis(2), g.Constant(center.z));
    const implicit::Node plane[2] = {x, y};
    const implicit::Node section[2] = {g.Sub(g.Length(plane), g.Constant(radius)), z};
    const double reach = radius + tube_radius;
    return {g.Sub(g.Length(section), implicit::AtLeastAVoxel(g, tube_radius)), -1,
            center - implicit::Vector{reach, reach, tube_radius},
            center + implicit::Vector{reach, reach, tube_radius}};
  }
};

}  // namespace voxeld::gpu
