// A parallelogram, given by its corner and two edges: its plane, bounded by the distance along each
// edge.
//
// Guarantee: covered voxels lie within h of the plane, or half a voxel (COVER: half a voxel's
// diagonal) if that is more, and within the rim. All voxels within h and the rim are covered, to
// within 0.02 voxel at the rim; within the rim no step passes through. The rim is cut along the
// normal.
#pragma once

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Patch {
  implicit::Vector corner, u, v;  // the edges must not be parallel

  implicit::FieldShape Make(implicit::Graph& g) const {
    using implicit::Vector;
    const Vector cross = implicit::Cross(u, v);
    const double area = implicit::Length(cross);
    const Vector normal = 1 / area * cross;
    implicit::FieldShape shape;
    shape.surface = implicit::Along(g, normal, implicit::Dot(normal, corner));
    const Vector edges[2] = {u, v};
    const Vector middle = corner + 0.5 * (u + v);
    for (int e = 0; e < 2; ++e) {
      // The distance from the line through the middle along the other edge.
      Vector across = implicit::Cross(edges[1 - e], normal);
      across = 1 / implicit::Length(across) * across;
      const double half = std::fabs(implicit::Dot(across, edges[e])) / 2;
      const implicit::Node within =
          g.Sub(g.Abs(implicit::Along(g, across, implicit::Dot(across, middle))),
                implicit::AtLeastAVoxel(g, half));
      shape.bound = e == 0 ? within : g.Max(shape.bound, within);
    }
    const Vector reach =
        0.5 * Vector{std::fabs(u.x) + std::fabs(v.x), std::fabs(u.y) + std::fabs(v.y),
                     std::fabs(u.z) + std::fabs(v.z)};
    shape.min = middle - reach;
    shape.max = middle + reach;
    return shape;
  }
};

}  // namespace voxeld::gpu
