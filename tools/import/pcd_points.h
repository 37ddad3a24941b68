// Point clouds of the Point Cloud Library (.pcd, version 0.7 and before).
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Data ascii, binary and binary_compressed. Takes the fields x, y, z; rgb or rgba (packed, as a float or a
// whole number); normal_x, normal_y, normal_z; intensity. Points that are not finite, as of rays that met
// nothing, are left out, and said. InvalidArgument names the line of the header or the point.
absl::StatusOr<Model> ReadPcdPoints(const SourceFile& file, bool attributes = false);

}  // namespace voxeld::voxelctl
