// Writes a captured volume in other programs' formats.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// The number of items in the file: points of a PLY, voxels of a .vox, lit pixels of an .npz.
struct ExportSummary {
  uint64_t items = 0;
  uint64_t bytes = 0;
  // Lit pixels without a position; for a .vox those outside of the display's grid.
  uint64_t left_out = 0;
  uint64_t models = 0;  // of a .vox
};

// Each function puts the file in place when it is complete. Error messages begin with the path,
// escaped for a terminal. Requires: `volume` has passed CheckVolume.

// Writes binary little-endian PLY 1.0: x, y, z in millimetres as float, red, green, blue as uchar;
// a vertex for each lit pixel.
absl::Status WritePly(const std::string& path, const Volume& volume, ExportSummary* summary);

// Writes MagicaVoxel, version 150. Voxels of the display's grid that contain a lit pixel get the
// colour of the brightest one. There is one model for each non-empty block of at most 256³, and
// nodes place the models with x and y centred and z from the ground up. The palette has 255
// colours, the means of similar ones if there are more. Errors: FailedPrecondition if nothing is
// lit, because the format has no empty scene.
absl::Status WriteVox(const std::string& path, const Volume& volume, ExportSummary* summary);

// Writes numpy arrays, deflated: "rgb", uint8 (slices, height, width, 3); "positions_mm", float32
// (n, 3), of the lit pixels in the order of rgb.any(axis=3).nonzero(), NaN for a pixel without a
// position; "metadata", a byte string of JSON. Errors: OutOfRange if an array is too large for a
// ZIP file without its extensions.
absl::Status WriteNpz(const std::string& path, const Volume& volume, ExportSummary* summary);

}  // namespace voxeld::voxelctl
