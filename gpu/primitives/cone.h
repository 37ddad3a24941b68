// The hull of two circles across a line, or of two spheres along it: cones, truncated cones,
// cylinders and capsules, each with two radii. Outside, P is the distance from the surface; past
// the rim of a flat end it is the greater of the distances from the planes and from the mantle.
// Inside, it is the distance from the nearest of the surfaces that make up the shape, which is too
// small by up to about the square of the depth over the diameter where a round end meets the
// mantle.
#pragma once

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Cone {
  implicit::Vector start, end;  // must differ
  double start_radius = 1, end_radius = 0;
  bool round = false;  // spheres at the ends, neither of which may contain the other

  // Returns, for spheres, whether one is within the other.
  bool OneHoldsTheOther() const {
    return round && implicit::Length(end - start) <= std::fabs(start_radius - end_radius);
  }

  implicit::FieldShape Make(implicit::Graph& g) const {
    using implicit::Node;
    using implicit::Vector;
    const double length = implicit::Length(end - start);
    const Vector axis = 1 / length * (end - start);
    const Node r0 = implicit::AtLeastAVoxel(g, start_radius),
               r1 = end_radius == 0 && !round ? g.Constant(0)
                                              : implicit::AtLeastAVoxel(g, end_radius);
    const Node along = implicit::Along(g, axis, implicit::Dot(axis, start));
    const Node across = implicit::DistanceFromAxis(g, start, axis);
    // The slope of the mantle: the radius falls by b per unit along the axis; a and b are its
    // normal.
    const Node fall = g.Div(g.Sub(r0, r1), g.Constant(length));
    implicit::FieldShape shape;
    if (round) {
      const Node b = fall, a = g.Sqrt(g.Sub(g.Constant(1), g.Square(b)));
      // The mantle touches the spheres where the foot of the point, along the normal, lies between
      // their centres.
      const Node foot = g.Sub(along, g.Mul(across, g.Div(b, a)));
      const Node mantle = g.Sub(g.Add(g.Mul(across, a), g.Mul(along, b)), r0);
      const Node head = g.Sub(implicit::DistanceFrom(g, end), r1);
      const Node tail = g.Sub(implicit::DistanceFrom(g, start), r0);
      // The union of both spheres and of the mantle where the foot is between them.
      const Node beyond = g.Max(g.Neg(foot), g.Sub(foot, g.Constant(length)));
      shape.surface = g.Min(g.Min(head, tail), g.Max(mantle, beyond));
    } else {
      const Node norm = g.Sqrt(g.Add(g.Constant(1), g.Square(fall)));
      const Node mantle = g.Div(g.Sub(g.Add(across, g.Mul(along, fall)), r0), norm);
      // A thin disc is drawn a voxel thick.
      const Node half = implicit::AtLeastAVoxel(g, length / 2);
      const Node ends = g.Sub(g.Abs(g.Sub(along, g.Constant(length / 2))), half);
      // If the shape is shorter than a voxel, the mantle continues that far beyond its ends.
      const Node within = g.Sub(across, g.Max(r0, r1));
      shape.surface = g.Max(g.Max(mantle, within), ends);
    }
    const double most = std::max(start_radius, end_radius);
    const Vector reach = {most, most, most};
    shape.min =
        Vector{std::min(start.x, end.x), std::min(start.y, end.y), std::min(start.z, end.z)} -
        reach;
    shape.max =
        Vector{std::max(start.x, end.x), std::max(start.y, end.y), std::max(start.z, end.z)} +
        reach;
    return shape;
  }
};

}  // namespace voxeld::gpu
