// Pictures of a captured volume.
#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/render/camera.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

struct RenderOptions {
  int width = 1200, height = 1000;  // 64 to 8192
  ViewAngles angles;
  bool around = false;  // as large as it is from any side: of pictures that turn
};

// InvalidArgument if the geometry is not valid, or its slices are not the volume's.
absl::Status CheckVolume(const Volume& volume);

// The volume in perspective on a dark ground: every lit slice pixel is a luminous cell, of a lattice
// a small ball, at its place in millimetres, dimmer with distance, in front of the glow of those behind it;
// around it the outline of the display's box or cylinder, in the corner the axes' directions.
// `volume` has passed CheckVolume.
Image RenderVolume(const Volume& volume, const RenderOptions& options);

// All slices side by side in rows, in the order in which they go out, v upwards,
// each in a thin frame; made smaller by a whole factor (a pixel is its brightest) where
// it would have over 8192 pixels a side. A lattice's slice is folded: u runs to the right in rows,
// from the lowest up, that make about a square; a light is a square of up to 8·8 pixels.
Image ContactSheet(const Volume& volume);

}  // namespace voxeld::voxelctl
