// Reads point clouds from PLY: files with vertices and no faces.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Requires: `header` is of `file`, and has vertices. Colors go as far as PlyColors says; without them intensities are greys. Points that are not a number are left out, and
// the model's note says how many.
// Returns: InvalidArgument with the number of the vertex that is cut off, no number or infinite.
absl::StatusOr<Model> ReadPlyPoints(const SourceFile& file, const PlyHeader& header,
                                    bool attributes = false);

}  // namespace voxeld::voxelctl
