// The solid inside closed curves in the plane z = 0, by the even-odd rule, from there down to z =
// −depth.
#pragma once

#include <span>

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Prism {
  std::span<const implicit::Vector> points;  // z is ignored
  std::span<const uint32_t> ends;            // of each curve among the points
  double depth = 1;                          // drawn at least a voxel thick

  implicit::FieldShape Make(implicit::Graph& g) const {
    implicit::FieldShape shape;
    const implicit::Node middle = g.Abs(implicit::Along(g, {0, 0, 1}, -depth / 2));
    shape.surface = g.Sub(middle, implicit::AtLeastAVoxel(g, depth / 2));
    shape.min = {points[0].x, points[0].y, -depth};
    shape.max = {points[0].x, points[0].y, 0};
    for (const implicit::Vector& p : points) {
      shape.min = {std::min(shape.min.x, p.x), std::min(shape.min.y, p.y), -depth};
      shape.max = {std::max(shape.max.x, p.x), std::max(shape.max.y, p.y), 0};
      for (const double c : {p.x, p.y, 0.0}) shape.ring_points.push_back(static_cast<float>(c));
    }
    shape.ring_ends.assign(ends.begin(), ends.end());
    shape.ring_axis = 2;
    return shape;
  }
};

}  // namespace voxeld::gpu
