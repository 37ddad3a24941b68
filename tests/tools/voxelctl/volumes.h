// Volumes for tests.
#pragma once

#include <vector>

#include "display/geometry/footprint.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

inline Volume DarkVolume(display::Geometry geometry, int width, int height) {
  Volume volume;
  volume.display = "test";
  volume.number = 7;
  geometry.grid = display::DefaultGrid(geometry);
  volume.geometry = geometry;
  volume.slices = display::SliceCount(geometry);
  volume.width = width;
  volume.height = height;
  volume.rgb.resize(volume.slice_bytes() * static_cast<size_t>(volume.slices));
  return volume;
}

// Horizontal slices, 1 mm apart in all directions, around the origin: pixel (u, v) of slice s is
// voxel (u, v, s).
inline Volume DarkStack(int width, int height, int slices) {
  display::PlanarStack stack;
  stack.width_px = width;
  stack.height_px = height;
  for (int i = 0; i < slices; ++i) stack.positions_mm.push_back(i - (slices - 1) / 2.0);
  return DarkVolume({.shape = stack, .grid = {}}, width, height);
}

inline void SetPixel(Volume* volume, int slice, int u, int v, std::vector<uint8_t> rgb) {
  uint8_t* at = volume->rgb.data() + (volume->pixel(slice, u, v) - volume->rgb.data());
  for (size_t c = 0; c < 3; ++c) at[c] = rgb[c];
}

}  // namespace voxeld::voxelctl
