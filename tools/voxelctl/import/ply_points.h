// Point clouds from PLY: files with vertices and no faces.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Requires: `header` is of `file`, and has vertices. Colors are on the full range of their type; floating-point ones go to 1, or to
// 255 where one of them is greater than 1. Points that are not a number are left out, and the model's note says how many.
// Returns: InvalidArgument with the number of the vertex that is cut off, no number or infinite.
absl::StatusOr<Model> ReadPlyPoints(const SourceFile& file, const PlyHeader& header,
                                    bool attributes = false);

}  // namespace voxeld::voxelctl
