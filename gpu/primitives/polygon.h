// A plane polygon of closed curves, including holes, by the even-odd rule: its plane, bounded by
// the curves projected along the axis nearest to its normal.
//
// Guarantee: covered voxels lie within h of the plane, or half a voxel (COVER: half a voxel's
// diagonal) if that is more, and within the rim. All voxels within h and the rim are covered, to
// within 0.02 voxel at the rim; within the rim no step passes through. Rims are cut along the axis
// nearest to the normal, so a shell's edge leans, by at most h·√2.
#pragma once

#include <cstddef>
#include <span>

#include "gpu/implicit/field_shape.h"

namespace voxeld::gpu {

struct Polygon {
  std::span<const implicit::Vector> points;
  std::span<const uint32_t> ends;  // of each curve among the points

  // Returns a normal of any length; zero if all points lie along one line. It is twice the area,
  // along its normal, of the greatest curve by Newell's sums, so that holes do not reduce it. If
  // curves cross themselves so that nothing is left, it is perpendicular to the direction of the
  // farthest point and to that of the point farthest from the line to it.
  implicit::Vector Normal() const {
    implicit::Vector normal;
    uint32_t begin = 0;
    for (const uint32_t end : ends) {
      implicit::Vector sum;
      for (uint32_t i = begin; i < end; ++i) {
        sum = sum + implicit::Cross(points[i] - points[begin],
                                    points[i + 1 < end ? i + 1 : begin] - points[begin]);
      }
      if (implicit::Length(sum) > implicit::Length(normal)) normal = sum;
      begin = end;
    }
    implicit::Vector far, across;
    for (const implicit::Vector& p : points) {
      if (implicit::Length(p - points[0]) > implicit::Length(far)) far = p - points[0];
    }
    for (const implicit::Vector& p : points) {
      const implicit::Vector c = implicit::Cross(far, p - points[0]);
      if (implicit::Length(c) > implicit::Length(across)) across = c;
    }
    return implicit::Length(normal) > 1e-3 * implicit::Length(across) ? normal : across;
  }
  // Returns how far the points are from the plane of `normal`, of any length, through their middle.
  double Unevenness(const implicit::Vector& normal) const {
    double least = 0, most = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      const double d = implicit::Dot(normal, points[i] - points[0]) / implicit::Length(normal);
      least = std::min(least, d);
      most = std::max(most, d);
    }
    return most - least;
  }

  // Requires: there is a normal.
  implicit::FieldShape Make(implicit::Graph& g) const {
    implicit::Vector normal = Normal();
    normal = 1 / implicit::Length(normal) * normal;
    implicit::FieldShape shape;
    shape.min = shape.max = points[0];
    double height = 0;
    for (const implicit::Vector& p : points) {
      height += implicit::Dot(normal, p) / static_cast<double>(points.size());
      shape.min = {std::min(shape.min.x, p.x), std::min(shape.min.y, p.y),
                   std::min(shape.min.z, p.z)};
      shape.max = {std::max(shape.max.x, p.x), std::max(shape.max.y, p.y),
                   std::max(shape.max.z, p.z)};
      for (int a = 0; a < 3; ++a) shape.ring_points.push_back(static_cast<float>(p[a]));
    }
    shape.surface = implicit::Along(g, normal, height);
    shape.ring_ends.assign(ends.begin(), ends.end());
    for (uint32_t a = 0; a < 3; ++a) {
      if (std::fabs(normal[static_cast<int>(a)]) >
          std::fabs(normal[static_cast<int>(shape.ring_axis)]))
        shape.ring_axis = a;
    }
    return shape;
  }
};

}  // namespace voxeld::gpu
