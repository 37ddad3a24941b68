// Pictures on disk.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "tools/voxelctl/render/palette.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Writes `image` to a temporary file beside `path` and renames it there when it is whole: a reader
// sees the old picture or the new one. The message of an error begins with the path.
absl::Status WritePng(const std::string& path, const Image& image);
// The same, with a palette in the file.
absl::Status WritePalettePng(const std::string& path, const PaletteImage& image);

}  // namespace voxeld::voxelctl
