// Shapes defined by measures, and implicit shapes. Data only. docs/primitives.md says which voxels
// each shape covers.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "voxeld/basics.h"
#include "voxeld/expression.h"

namespace voxeld::client {

// An ellipsoid along the axes.
struct Ellipsoid {
  Vec3 center;
  Vec3 radii = {1, 1, 1};
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;  // only with Fill::kSurface
};

// A torus around its own z axis.
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

// A box in any orientation.
struct Parallelepiped {
  Vec3 center;
  Vec3 edge_a = {1, 0, 0}, edge_b = {0, 1, 0}, edge_c = {0, 0, 1};  // full edges
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// A disc perpendicular to its normal; with an inner radius, a ring.
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

// Closed plane curves, by the even-odd rule: curves inside others are holes.
struct Polygon {
  std::vector<std::vector<Vec3>> curves;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
  Fill fill = Fill::kSurface;  // or lines, or dots
};

// A shaft with a conical head.
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

// A circle or an arc of one; angles are in radians, counter-clockwise as seen from where the normal
// points to.
struct Arc {
  Vec3 center;
  Vec3 normal = {0, 0, 1};
  double radius = 1;
  std::optional<Vec3> toward;  // the side of angle 0; default: x, or y where the normal is along x
  double start = 0;
  double sweep = 0;  // -2π to 2π; 0: all around
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// An ellipse or an arc of one: center + cos(t)·axis_a + sin(t)·axis_b.
struct Ellipse {
  Vec3 center;
  Vec3 axis_a = {1, 0, 0}, axis_b = {0, 1, 0};  // half axes
  double start = 0;
  double sweep = 0;  // -2π to 2π; 0: all around
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// A line that winds around the axis from `start` to `end`.
struct Helix {
  Vec3 start;
  Vec3 end = {0, 0, 1};
  double radius = 1;
  std::optional<double> end_radius;  // default: as at the start
  double turns = 1;                  // right-handed; negative: left-handed
  std::optional<Vec3> toward;        // the side on which it begins
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// Text in any script, in the server's fonts.
struct Text {
  enum class Style : uint8_t { kFilled, kOutline, kStrokes };
  enum class Alignment : uint8_t { kLeft, kCenter, kRight };

  std::string text;         // UTF-8; lines end at \n
  double height = 0.2;      // of capital letters
  Vec3 position;            // on the first line's base line
  Vec3 facing = {0, 0, 1};  // toward the reader
  // the letters' up direction; default: y, or z where the text faces along y
  std::optional<Vec3> up;
  Style style = Style::kFilled;
  Alignment alignment = Alignment::kLeft;
  double line_spacing = 1;
  double width = 0;  // lines are broken between words to be no longer than this; 0: only at \n
  std::string font;  // a family, or for strokes a Hershey font; empty: the server's choice
  double depth = 0;  // filled letters are solid and extend this far to the back; 0: flat
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness thickness;  // of lines, and of flat letters
};

// The implicit shape: a surface P bounded by Φ.
struct Implicit {
  enum class Axis : uint8_t { kZ, kX, kY };
  enum class BoundaryForm : uint8_t { kPolyline, kCatmullRom, kBSpline };

  Expression surface;  // "x^2 + y^2 - z = 0 where x^2 + y^2 <= 1"
  Expression bound;    // a condition; empty: none
  // Closed curves, projected along an axis: only what lies inside them is drawn.
  std::vector<std::vector<Vec3>> boundary;
  Axis boundary_axis = Axis::kZ;
  BoundaryForm boundary_form =
      BoundaryForm::kPolyline;               // or smooth: through the points, or near them
  std::map<std::string, double> parameters;  // parameters that expressions name
  std::optional<Fill> fill;  // default: solid for an inequality, the surface for all else
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
  std::optional<Region> domain;
  // Red, green and blue, 0 to 1 each: all three; or a level of 0 to 1 and the name of a colour map.
  Expression red, green, blue, level;
  std::string colormap;
};

}  // namespace voxeld::client
