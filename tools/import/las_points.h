// Laser scans of the ASPRS (.las, versions 1.0 to 1.4; "LAS Specification 1.4 – R15").
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Point formats 0 to 10, in their colours or else their intensities. Colours are 16 bits, or 8 where none is greater
// than 255, as some programs write them. Points that are withheld are left out, and said. Compressed ones (.laz) are refused by name.
absl::StatusOr<Model> ReadLasPoints(const SourceFile& file, bool attributes = false);

}  // namespace voxeld::voxelctl
