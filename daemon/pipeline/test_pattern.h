// Test patterns: small scenes in voxel units, drawn by the same engine as any other.
#pragma once

#include "daemon/pipeline/display_settings.h"
#include "daemon/scene/snapshot.h"
#include "display/api/geometry.h"

namespace voxeld::daemon {

// A snapshot whose coordinates are voxels of `grid` (the view is the identity), to be shown in
// place of scene number `number`. Its layers' and entities' numbers are none that a scene uses.
// `pattern` is not kNone.
//   kAxes     x red, y green, z blue, from the middle to the positive faces
//   kCorners  the edges of the grid in grey, each corner a ball in its own colour
//   kGrid     dots of one voxel, eight apart on every axis
//   kRamp     brightness from 0 to 255 along x, on three middle planes
//   kWhite    every voxel
//   kBars     eight bars along x: white, yellow, cyan, green, magenta, red, blue and black, in the whole volume
//   kDensity  brightness from 0 to 255 along x in the whole volume: what is uneven shows
//   kSlices   the number of every slice in its own pixels (slice_numbers.h)
// In a lattice three of them keep to where lights are:
//   kCorners  each corner moves to the light that is nearest to it
//   kGrid     every eighth pixel of each slice, where it has a light
//   kRamp     in the whole volume
SnapshotPtr MakePattern(TestPattern pattern, const display::Geometry& geometry, uint64_t number);

}  // namespace voxeld::daemon
