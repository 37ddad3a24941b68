// What a volumetric display is, as data: its voxel grid and how its slices sweep through it. Words
// only; display/geometry computes with them.
//
// Space: right-handed, millimetres, +Z is the display's vertical axis, the origin is the middle of
// the volume. Voxel (i,j,k) is the half-open cell origin_mm + [i,i+1)×[j,j+1)×[k,k+1) · pitch_mm.
#pragma once

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
  // Where each slice stands on the normal's axis, mm, strictly ascending; 1 to 16384 of them. Slice
  // s stands for the slab from half-way to its predecessor to half-way to its successor; the outer
  // two reach as far outward as inward (a single slice: thickness_mm).
  std::vector<double> positions_mm;
  double thickness_mm = 1;  // of the slab of a single slice only
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
    double shift_u_mm = 0;                  // of the panel's middle along u
    double shift_v_mm = 0;                  // of the panel's middle along +z
    double phase_turns = 0;  // [0,1): angle of the panel at turn angle 0, always counter-clockwise
    bool mirror_u = false, mirror_v = false;
    bool operator==(const Panel&) const = default;
  };
  int32_t slices_per_turn = 0;          // 1 to 16384
  int32_t width_px = 0, height_px = 0;  // of every panel, 1 to 16384
  std::vector<Panel> panels;            // 1 to 16
  bool clockwise = false;
  bool operator==(const Rotor&) const = default;
};

// Lights at points, in whatever arrangement: an LED lattice. A slice is what goes out together (a
// controller's lights), its pixels in one row, height_px = 1.
struct Lattice {
  int32_t width_px = 0;   // lights a slice, 1 to 16384
  int32_t height_px = 1;  // always
  // Slice after slice, width_px each; 1 to 16384 slices, 2²⁴ pixels in all at the most. Nothing: no
  // light is there, the pixel stays dark; one light at least.
  std::vector<std::optional<Vec3>> points_mm;
  // The size of the half-open box for which a light stands; the light is in its middle. > 0.
  Vec3 cell_mm{1, 1, 1};
  bool operator==(const Lattice&) const = default;
};

// Slices are numbered as they go out: for a PlanarStack slice s is positions_mm[s];
// for a Rotor slice s·panels + p is panel p while the rotor turns
// through [s−½, s+½) / slices_per_turn of a turn; for a Lattice pixel u of slice s is
// points_mm[s·width_px + u].
struct Geometry {
  std::variant<PlanarStack, Rotor, Lattice> shape;
  VoxelGrid grid;
  bool operator==(const Geometry&) const = default;
};

}  // namespace voxeld::display
