// A captured volume in other programs' formats.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// What went into a file: points of a PLY, voxels of a .vox, lit pixels of an .npz.
struct ExportSummary {
  uint64_t items = 0;
  uint64_t bytes = 0;
  uint64_t left_out = 0;  // lit pixels that lie nowhere; of a .vox outside of the display's grid
  uint64_t models = 0;    // of a .vox
};

// Each puts the file in place when it is whole. Messages of errors begin with the path, made fit for a terminal. `volume`
// has passed CheckVolume.

// Binary PLY 1.0 in little endian: x, y, z in millimetres as float, red, green, blue as uchar; a vertex for each lit pixel.
absl::Status WritePly(const std::string& path, const Volume& volume, ExportSummary* summary);

// MagicaVoxel, version 150: voxels of the display's grid that a lit pixel is in (the brightest of them), one model for each
// block of at most 256³ that has any, put together by nodes with x and y about the middle and z from the ground up; a palette of 255
// colours, means of those that are alike where there are more. FailedPrecondition where nothing is lit: the format has no empty
// scene.
absl::Status WriteVox(const std::string& path, const Volume& volume, ExportSummary* summary);

// Arrays of numpy, deflated: "rgb", uint8 (slices, height, width, 3); "positions_mm", float32 (n, 3), of the lit pixels in the
// order of rgb.any(axis=3).nonzero(), NaN where one lies nowhere; "metadata", a byte string of JSON. OutOfRange where an array is
// too large for a ZIP file without its extensions.
absl::Status WriteNpz(const std::string& path, const Volume& volume, ExportSummary* summary);

}  // namespace voxeld::voxelctl
