// A box spanned by three edges around a centre: P is the greatest of the distances from the planes
// of its faces.
#pragma once

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Parallelepiped {
  implicit::Vector center, edges[3];  // full edges

  double volume() const {
    return std::fabs(implicit::Dot(edges[0], implicit::Cross(edges[1], edges[2])));
  }

  implicit::FieldShape Make(implicit::Graph& g) const {
    implicit::FieldShape shape;
    implicit::Vector reach;
    for (int a = 0; a < 3; ++a) {
      implicit::Vector normal = implicit::Cross(edges[(a + 1) % 3], edges[(a + 2) % 3]);
      normal = 1 / implicit::Length(normal) * normal;
      const double half = std::fabs(implicit::Dot(normal, edges[a])) / 2;
      const implicit::Node face =
          g.Sub(g.Abs(implicit::Along(g, normal, implicit::Dot(normal, center))),
                implicit::AtLeastAVoxel(g, half));
      shape.surface = a == 0 ? face : g.Max(shape.surface, face);
      reach = reach + 0.5 * implicit::Vector{std::fabs(edges[a].x), std::fabs(edges[a].y),
                                             std::fabs(edges[a].z)};
    }
    shape.min = center - reach;
    shape.max = center + reach;
    return shape;
  }
};

}  // namespace voxeld::gpu
