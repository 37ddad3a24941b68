// Writes PNG files.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "tools/voxelctl/render/palette.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Writes `image` to a temporary file beside `path` and renames it to `path` when it is complete: a
// reader sees either the old picture or the new one. Error messages begin with the path.
absl::Status WritePng(const std::string& path, const Image& image);
// Does the same, with a palette in the file.
absl::Status WritePalettePng(const std::string& path, const PaletteImage& image);

}  // namespace voxeld::voxelctl
