// Renders pictures of a captured volume.
#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/render/camera.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

struct RenderOptions {
  int width = 1200, height = 1000;  // 64 to 8192
  ViewAngles angles;
  bool around = false;  // fits the volume from any side: for rotating pictures
};

// Errors: InvalidArgument if the geometry is not valid or does not match the volume's slices.
absl::Status CheckVolume(const Volume& volume);

// Renders the volume in perspective on a dark background. Every lit slice pixel is a luminous cell
// (a small ball in a lattice) at its position in millimetres, dimmer with distance, in front of the
// glow of those behind it. The outline of the display's box or cylinder is drawn around it, and the
// axes' directions in the corner. Requires: `volume` has passed CheckVolume.
Image RenderVolume(const Volume& volume, const RenderOptions& options);

// Renders all slices side by side in rows, in output order, v upwards, each in a thin frame. The
// sheet is reduced by an integer factor (a pixel is the brightest of its block) if a side would
// exceed 8192 pixels. A lattice's slice is folded: u runs to the right in rows, starting with the
// lowest, that form about a square; a light is a square of up to 8·8 pixels.
Image ContactSheet(const Volume& volume);

}  // namespace voxeld::voxelctl
