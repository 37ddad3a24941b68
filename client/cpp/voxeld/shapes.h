// Shapes by their measures, and the general method. Words only. docs/primitives.md says of each which
// voxels it covers.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "voxeld/basics.h"

namespace voxeld::client {

// Along the axes.
struct Ellipsoid {
  Vec3 center;
  Vec3 radii = {1, 1, 1};
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;  // of a surface
};

// Around its own z axis.
struct Torus {
  Vec3 center;
  double radius = 1;
  double tube_radius = 0.25;
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// From `start` to `end`: a cone, a cylinder or, with round ends, a capsule, with a radius at either end.
struct Cone {
  Vec3 start;
  Vec3 end = {0, 0, 1};
  double start_radius = 1;
  double end_radius = 0;
  bool round_ends = false;
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// A box in any position.
struct Parallelepiped {
  Vec3 center;
  Vec3 edge_a = {1, 0, 0}, edge_b = {0, 1, 0}, edge_c = {0, 0, 1};  // full edges
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// Across its normal; with an inner radius, a ring.
struct Disc {
  Vec3 center;
  Vec3 normal = {0, 0, 1};
  double radius = 1;
  double inner_radius = 0;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// A parallelogram.
struct Patch {
  Vec3 corner;
  Vec3 edge_a = {1, 0, 0}, edge_b = {0, 1, 0};
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// Closed plane curves, by the even-odd rule: curves within others are holes.
struct Polygon {
  std::vector<std::vector<Vec3>> curves;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// The general method: a surface P bounded by Φ, as expressions of the shape's own coordinates
// (docs/expressions.md).
struct Implicit {
  enum class Axis : uint8_t { kZ, kX, kY };

  std::string surface;  // "x^2 + y^2 - z = 0 where x^2 + y^2 <= 1"
  std::string bound;    // a condition; empty: none
  // Closed curves, projected along an axis: what lies within them is drawn.
  std::vector<std::vector<Vec3>> boundary;
  Axis boundary_axis = Axis::kZ;
  std::map<std::string, double> parameters;  // that expressions name
  std::optional<Fill> fill;  // else solid for an inequality, the surface for all else
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
  std::optional<Region> domain;
  // Red, green and blue, 0 to 1 each: all three; or a level of 0 to 1 and the name of a colour map.
  std::string red, green, blue, level, colormap;
};

}  // namespace voxeld::client
