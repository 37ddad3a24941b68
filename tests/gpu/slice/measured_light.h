// How evenly a display lights a solid of one colour, as measured in space: where the light of its pixels is in truth, by
// positions in closed form, not by footprints.
#pragma once

#include <cstdint>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"

namespace voxeld::gpu {

// Of cubes of 4 pitches wholly within reach and beyond 2 pitches from a turning display's axis, in one volume.
struct MeasuredLight {
  int64_t cubes = 0;
  double mean = 0, least = 0, most = 0;  // light of a cube, in pixels at full light
  double variation = 0;                  // standard deviation by mean
};

struct DisplayUnderTest {
  display::Geometry geometry;
  display::FrameLayout layout;
  display::Tone tone;
};

// A solid of white that fills the display. Where rows and columns of pixels are alike, 64 of them (the period of dither) are
// looked at.
MeasuredLight MeasureLight(const DisplayUnderTest& display);

// Voxels within reach that, lit alone in white, light no pixel in any sub-frame; and how many are within reach. Of the same
// rows of pixels.
struct DarkVoxels {
  int64_t dark = 0, reachable = 0;
};
DarkVoxels CountDarkVoxels(const DisplayUnderTest& display);

}  // namespace voxeld::gpu
