// The description of a volumetric display as data: its voxel grid and how its slices sweep through
// it. display/geometry computes with it.
//
// Space: right-handed, millimetres, +Z is the display's vertical axis, the origin is the middle of
// the volume. Voxel (i,j,k) is the half-open cell origin_mm + [i,i+1)×[j,j+1)×[k,k+1) · pitch_mm.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace voxeld::display {

struct Vec3 {
  double x = 0, y = 0, z = 0;
  bool operator==(const Vec3&) const = default;
};

// nx·ny·nz cells; pitches > 0 mm, not necessarily equal.
struct VoxelGrid {
  int32_t nx = 0, ny = 0, nz = 0;
  Vec3 pitch_mm;
  Vec3 origin_mm;  // the corner of voxel (0,0,0)
  bool operator==(const VoxelGrid&) const = default;
};

// Parallel flat slices: a screen that reciprocates, stacked LC panels, an LED lattice.
struct PlanarStack {
  enum class Normal : uint8_t {
    kZ,  // slices lie flat: u runs along +x, v along +y (a reciprocating screen)
    kY,  // slices stand: u runs along +x, v along +z (stacked panels, seen from −y)
  };
  Normal normal = Normal::kZ;
  int32_t width_px = 0, height_px = 0;    // 1 to 16384
  double pitch_u_mm = 1, pitch_v_mm = 1;  // > 0
  // Where each slice stands on the normal's axis, mm, in the order in which they are sent; 1 to
  // 16384 of them. Each stroke has the same number, strictly ascending or descending within it, and
  // a second stroke runs the other way. Each stroke shows the whole depth: a slice represents the
  // slab from half-way to one neighbour in its stroke to half-way to the other; the outer two
  // extend as far outward as inward (a single slice: thickness_mm).
  std::vector<double> positions_mm;
  int32_t strokes = 1;      // 1 or 2
  double thickness_mm = 1;  // slab of a single slice only
  bool mirror_u = false, mirror_v = false;
  bool operator==(const PlanarStack&) const = default;
};

// LED panels that spin about the vertical axis. At turn angle 0 a panel with phase 0 lies in the
// plane y = eccentricity_mm with u along +x; v runs up, along +z. Turning is counter-clockwise seen
// from above, unless `clockwise`.
struct Rotor {
  struct Panel {
    double pitch_u_mm = 1, pitch_v_mm = 1;  // > 0
    double eccentricity_mm = 0;             // distance of the panel's plane from the axis; signed
    double shift_u_mm = 0;                  // displacement of the panel's middle along u
    double shift_v_mm = 0;                  // displacement of the panel's middle along its v axis
    double phase_turns = 0;  // [0,1): angle of the panel at turn angle 0, always counter-clockwise
    bool mirror_u = false, mirror_v = false;
    // Tilt about the panel's u axis: v runs along cos·(+z) + sin·(the direction in which
    // eccentricity counts). −60 to 60.
    float tilt_deg = 0;
    bool operator==(const Panel&) const = default;
  };
  int32_t slices_per_turn = 0;          // 1 to 16384
  int32_t width_px = 0, height_px = 0;  // of every panel, 1 to 16384
  std::vector<Panel> panels;            // 1 to 16
  bool clockwise = false;
  bool operator==(const Rotor&) const = default;
};

// A screen of helical blades that turns about the vertical axis under an image projected from above
// or below: u runs along +x, v along +y. A blade begins at the bottom, at the turn angle plus
// (phase_turns + its number / blades) of a turn, and rises evenly to height_mm over `span_turns` of
// a turn, counter-clockwise seen from above, as a right-handed screw. Turning is counter-clockwise,
// unless `clockwise`.
struct Helix {
  int32_t slices_per_turn = 0;            // 1 to 16384
  int32_t width_px = 0, height_px = 0;    // 1 to 16384
  double pitch_u_mm = 1, pitch_v_mm = 1;  // > 0
  int32_t blades = 1;                     // 1 to 10
  double span_turns = 1;                  // of a blade: 0.1 to 1, at most 1 / blades
  double height_mm = 1;                   // > 0; the blades' middle is at z = 0
  double hub_mm = 0, radius_mm = 1;       // the blades extend from hub to radius
  double phase_turns = 0;                 // [0,1)
  bool left_handed = false;               // the blade rises clockwise
  bool clockwise = false;
  bool mirror_u = false, mirror_v = false;
  bool operator==(const Helix&) const = default;
};

// Lights at arbitrary points: an LED lattice. A slice is the lights that are sent together (a
// controller's lights), with its pixels in one row, height_px = 1.
struct Lattice {
  int32_t width_px = 0;   // lights a slice, 1 to 16384
  int32_t height_px = 1;  // always
  // Slice after slice, width_px each; 1 to 16384 slices, at most 2²⁴ pixels in all. An empty entry
  // has no light, and the pixel stays dark; at least one light is required.
  std::vector<std::optional<Vec3>> points_mm;
  // The size of the half-open box that a light represents; the light is in its middle. > 0.
  Vec3 cell_mm{1, 1, 1};
  bool operator==(const Lattice&) const = default;
};

// Displacements in mm, at nx·ny·nz places evenly spaced from low_mm to high_mm (x fastest),
// trilinear in between, and constant beyond the border. 2 to 64 places along each axis.
struct DisplacementGrid {
  int32_t nx = 0, ny = 0, nz = 0;
  Vec3 low_mm, high_mm;
  std::vector<Vec3> at_mm;
  bool operator==(const DisplacementGrid&) const = default;
};

// The measured deviation of a display's light from its shape. A nominal place p has the true place
// A·p + D(p), and in a planar stack or a helix the nominal places of a slice's pixels are first
// moved by a homography of the slice image.
struct Correction {
  // Rows of A, 3 by 4, millimetres in the last column. Its determinant is from 1/8 to 8, its norm and its inverse's
  // (the roots of the sums of squares) at most 16.
  std::array<double, 12> affine{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  // D. Its steepest change per distance along x, y and z (the root of the sum of squares), times
  // the norm of A's inverse, is at most 0.9.
  std::optional<DisplacementGrid> displacement = {};
  // None, one for all slices or one for each: 3 by 3, row by row; maps (u, v, 1), mm from the
  // middle of the slice image, to its place (x/w, y/w). Over the whole image w is from 1/8 to 8,
  // and the map keeps the orientation.
  std::vector<std::array<double, 9>> homographies;
  bool operator==(const Correction&) const = default;
};

// Slices are numbered in the order in which they are sent: for a PlanarStack slice s is
// positions_mm[s]; for a Rotor slice s·panels + p is panel p while the rotor turns through [s−½,
// s+½) / slices_per_turn of a turn; for a Helix slice s is the image for such a part of a turn; for
// a Lattice pixel u of slice s is points_mm[s·width_px + u].
struct Geometry {
  std::variant<PlanarStack, Rotor, Lattice, Helix> shape;
  VoxelGrid grid;
  std::optional<Correction> correction = {};
  bool operator==(const Geometry&) const = default;
};

}  // namespace voxeld::display
