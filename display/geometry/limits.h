// The limits of ValidateGeometry. Together they keep every integer of display/geometry within 64
// bits.
#pragma once

#include <cstdint>

namespace voxeld::display {

inline constexpr int64_t kMaxPixelsPerAxis = 16384;  // width_px, height_px
inline constexpr int64_t kMaxSliceSteps = 16384;     // positions_mm, slices_per_turn
inline constexpr int64_t kMaxPanels = 16;
inline constexpr int64_t kMaxCellsPerAxis = 16384;       // nx, ny, nz; coordinates fit 16 bits
inline constexpr int64_t kMaxCells = int64_t{1} << 36;   // nx·ny·nz
inline constexpr int64_t kMaxPixels = int64_t{1} << 34;  // slices·width·height
// Upper bound of a footprint table's entries, checked before it is built: 8 bytes each.
inline constexpr int64_t kMaxFootprintEntries = int64_t{1} << 28;
// slices·width_px of a lattice, each of which takes 32 bytes of memory, with or without a light.
inline constexpr int64_t kMaxLatticePixels = int64_t{1} << 24;
// slices·width·height if footprints are stored per pixel: for a helix, a tilted panel, and with a
// correction.
inline constexpr int64_t kMaxFlatPixels = int64_t{1} << 27;
inline constexpr int32_t kMaxDisplacements = 64;  // along an axis
inline constexpr double kMaxTiltDeg = 60;
inline constexpr double kMinSpanTurns = 0.1;
inline constexpr int64_t kMaxBlades = 10;
inline constexpr double kMinPitchMm = 1e-4, kMaxPitchMm = 1e4;
inline constexpr double kMaxPositionMm = 1e6;  // either side of the middle
// A rotor's grid and panels lie within this many of the grid's smaller horizontal pitch from the
// axis.
inline constexpr int64_t kMaxRotorReach = 16384;
// Neighbouring slices of a stack are at least this fraction of a voxel apart.
inline constexpr double kMinSpacingVoxels = 1.0 / 1024;

}  // namespace voxeld::display
