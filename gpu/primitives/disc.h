// A disc across its normal, or a ring: its plane, bounded by the distance from its axis.
//
// Guarantee: covered voxels lie within h of the plane, or half a voxel (COVER: half a voxel's
// diagonal) if that is more, and within the rim. All voxels within h and the rim are covered, to
// within 0.02 voxel at the rim; within the rim no step passes through. The rim is cut along the
// normal.
#pragma once

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Disc {
  implicit::Vector center, normal;  // of any length but 0
  double radius = 1, inner_radius = 0;

  implicit::FieldShape Make(implicit::Graph& g) const {
    const implicit::Vector unit = 1 / implicit::Length(normal) * normal;
    const implicit::Node distance = implicit::DistanceFromAxis(g, center, unit);
    implicit::Node bound = g.Sub(distance, implicit::AtLeastAVoxel(g, radius));
    if (inner_radius > 0) bound = g.Max(bound, g.Sub(g.Constant(inner_radius), distance));
    implicit::Vector reach = {radius * std::sqrt(1 - std::min(1.0, unit.x * unit.x)),
                              radius * std::sqrt(1 - std::min(1.0, unit.y * unit.y)),
                              radius * std::sqrt(1 - std::min(1.0, unit.z * unit.z))};
    return {implicit::Along(g, unit, implicit::Dot(unit, center)), bound, center - reach,
            center + reach};
  }
};

}  // namespace voxeld::gpu
