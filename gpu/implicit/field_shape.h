// A primitive that is drawn by the general method: its surface and bounds as nodes of a graph, its
// extent, and the curves that bound it. The headers of such primitives (gpu/primitives/) create
// these.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "gpu/implicit/graph.h"

namespace voxeld::gpu::implicit {

using Node = Graph::Node;

struct Vector {
  double x = 0, y = 0, z = 0;

  double operator[](int a) const { return a == 0 ? x : a == 1 ? y : z; }
  friend Vector operator+(const Vector& a, const Vector& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend Vector operator-(const Vector& a, const Vector& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend Vector operator*(double s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
};
inline double Dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector Cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double Length(const Vector& a) { return std::sqrt(Dot(a, a)); }

struct FieldShape {
  Node surface = -1, bound = -1;
  // A box that contains it; shells and thickness beyond its own size are not included.
  Vector min, max;
  std::vector<float> ring_points;  // x y z
  std::vector<uint32_t> ring_ends;
  uint32_t ring_axis = 2;
};

// Returns the radius, but at least 0.87 voxel: a thinner solid or a smaller surface is drawn
// larger, so that it is not lost between the voxels' centres. No point is farther than √¾ voxel
// from a centre.
inline Node AtLeastAVoxel(Graph& g, double radius) {
  return g.Max(g.Constant(radius), g.Mul(g.Constant(0.87), g.Voxel()));
}

// Returns p·v − offset for the point p.
inline Node Along(Graph& g, const Vector& v, double offset) {
  Node sum = -1;
  for (int a = 0; a < 3; ++a) {
    if (v[a] == 0) continue;
    const Node term = g.Mul(g.Constant(v[a]), g.Axis(a));
    sum = sum < 0 ? term : g.Add(sum, term);
  }
  if (sum < 0) return g.Constant(-offset);
  return offset == 0 ? sum : g.Sub(sum, g.Constant(offset));
}
// Returns |p − center|.
inline Node DistanceFrom(Graph& g, const Vector& center) {
  const Node d[3] = {Along(g, {1, 0, 0}, center.x), Along(g, {0, 1, 0}, center.y),
                     Along(g, {0, 0, 1}, center.z)};
  return g.Length(d);
}
// Returns the distance of the point from the line through `center` along the unit vector `axis`.
inline Node DistanceFromAxis(Graph& g, const Vector& center, const Vector& axis) {
  // Choose the two other axes of a frame.
  const Vector least =
      std::fabs(axis.x) < std::fabs(axis.y)
          ? (std::fabs(axis.x) < std::fabs(axis.z) ? Vector{1, 0, 0} : Vector{0, 0, 1})
          : (std::fabs(axis.y) < std::fabs(axis.z) ? Vector{0, 1, 0} : Vector{0, 0, 1});
  Vector u = Cross(least, axis);
  u = 1 / Length(u) * u;
  const Vector v = Cross(axis, u);
  const Node d[2] = {Along(g, u, Dot(u, center)), Along(g, v, Dot(v, center))};
  return g.Length(d);
}

}  // namespace voxeld::gpu::implicit
