// Geometries of every kind, for tests that apply to all.
#pragma once

#include <string>
#include <vector>

#include "display/api/geometry.h"

namespace voxeld::display {

struct GeometryCase {
  std::string name;  // letters and digits
  Geometry geometry;
};

std::vector<GeometryCase> StackCases();
std::vector<GeometryCase> RotorCases();
std::vector<GeometryCase> LatticeCases();  // lattice_cases.cc
std::vector<GeometryCase> AllCases();
std::vector<GeometryCase> FlatCases();  // flat_cases.cc; not included in all

// Returns `count` positions, `spacing_mm` apart, around `middle_mm`.
std::vector<double> EvenPositions(int count, double spacing_mm, double middle_mm = 0);

// The multivox Vortex: two panels of 128×64, back to back, in units of its LED pitch.
Rotor Vortex(int slices_per_turn);

// Returns nx·ny·nz lights in rows, `pitch_mm` apart, around the middle of the volume, x fastest; a
// slice has the lights at one height. Their cell is the pitch.
Lattice RegularLattice(int nx, int ny, int nz, Vec3 pitch_mm);

// Returns a grid of nx·ny·nz cells around the middle of the volume.
VoxelGrid CentredGrid(int nx, int ny, int nz, Vec3 pitch_mm);

}  // namespace voxeld::display
