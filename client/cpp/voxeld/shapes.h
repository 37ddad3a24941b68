// Shapes by their measures, and the general method. Words only. docs/primitives.md says of each which
// voxels it covers.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "voxeld/basics.h"
#include "voxeld/expression.h"

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
  Fill fill = Fill::kSurface;  // or lines, or dots
};

// A parallelogram.
struct Patch {
  Vec3 corner;
  Vec3 edge_a = {1, 0, 0}, edge_b = {0, 1, 0};
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
  Fill fill = Fill::kSurface;  // or lines, or dots
};

// Closed plane curves, by the even-odd rule: curves within others are holes.
struct Polygon {
  std::vector<std::vector<Vec3>> curves;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
  Fill fill = Fill::kSurface;  // or lines, or dots
};

// A shaft with a cone at its end.
struct Arrow {
  Vec3 start;
  Vec3 end = {0, 0, 1};     // the tip
  double shaft_radius = 0;  // 0: as thin as a voxel
  double head_length = 0;   // 0: a quarter of the length
  double head_radius = 0;   // 0: two fifths of the head's length
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// A circle, or a part of it: angles in radians, counter-clockwise as seen from where the normal points to.
struct Arc {
  Vec3 center;
  Vec3 normal = {0, 0, 1};
  double radius = 1;
  std::optional<Vec3> toward;  // the side of angle 0; else x, or y where the normal is along x
  double start = 0;
  double sweep = 0;  // -2π to 2π; 0: all around
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// center + cos(t)·axis_a + sin(t)·axis_b, or a part of it.
struct Ellipse {
  Vec3 center;
  Vec3 axis_a = {1, 0, 0}, axis_b = {0, 1, 0};  // half axes
  double start = 0;
  double sweep = 0;  // -2π to 2π; 0: all around
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// A line that winds around the one from `start` to `end`.
struct Helix {
  Vec3 start;
  Vec3 end = {0, 0, 1};
  double radius = 1;
  std::optional<double> end_radius;  // else as at the start
  double turns = 1;                  // right-handed; left-handed where negative
  std::optional<Vec3> toward;        // it begins on this side
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// In any script, by the server's fonts.
struct Text {
  enum class Style : uint8_t { kFilled, kOutline, kStrokes };
  enum class Alignment : uint8_t { kLeft, kCenter, kRight };

  std::string text;         // UTF-8; lines end at \n
  double height = 0.2;      // of capital letters
  Vec3 position;            // on the first line's base line
  Vec3 facing = {0, 0, 1};  // to where it is read from
  std::optional<Vec3> up;   // of letters; else y, or z where it faces along y
  Style style = Style::kFilled;
  Alignment alignment = Alignment::kLeft;
  double line_spacing = 1;
  double width = 0;  // lines are broken between words so as not to be longer; 0: only at \n
  std::string font;  // a family, or of strokes one of Hershey's; empty: the server's choice
  double depth = 0;  // filled letters are solid and reach this far to the back; 0: flat
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness thickness;  // of lines, and of flat letters
};

// The general method: a surface P bounded by Φ.
struct Implicit {
  enum class Axis : uint8_t { kZ, kX, kY };
  enum class BoundaryForm : uint8_t { kPolyline, kCatmullRom, kBSpline };

  Expression surface;  // "x^2 + y^2 - z = 0 where x^2 + y^2 <= 1"
  Expression bound;    // a condition; empty: none
  // Closed curves, projected along an axis: what lies within them is drawn.
  std::vector<std::vector<Vec3>> boundary;
  Axis boundary_axis = Axis::kZ;
  BoundaryForm boundary_form =
      BoundaryForm::kPolyline;               // or smooth: through the points, or near them
  std::map<std::string, double> parameters;  // that expressions name
  std::optional<Fill> fill;  // else solid for an inequality, the surface for all else
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
  std::optional<Region> domain;
  // Red, green and blue, 0 to 1 each: all three; or a level of 0 to 1 and the name of a colour map.
  Expression red, green, blue, level;
  std::string colormap;
};

}  // namespace voxeld::client
