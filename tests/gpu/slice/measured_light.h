// Measures in space how evenly a display lights a solid of one colour: the true places of the light
// of its pixels are computed in closed form, not from footprints.
#pragma once

#include <cstdint>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"

namespace voxeld::gpu {

// For cubes of 4 pitches that are completely within reach and more than 2 pitches from the axis of
// a rotating display, in one volume.
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

// Measures a white solid that fills the display. If rows and columns of pixels are alike, 64 of
// them (the period of dither) are examined.
MeasuredLight MeasureLight(const DisplayUnderTest& display);

// Voxels within reach that, lit alone in white, light no pixel in any sub-frame; and the number of
// voxels within reach. For the same rows of pixels.
struct DarkVoxels {
  int64_t dark = 0, reachable = 0;
};
DarkVoxels CountDarkVoxels(const DisplayUnderTest& display);

}  // namespace voxeld::gpu
