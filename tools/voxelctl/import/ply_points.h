// Point clouds from PLY: files with vertices and no faces.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Takes x, y, z; nx, ny, nz; red, green, blue (also r, g, b and diffuse_…) of any type: integers on
// the full range of their type, floats from 0 to 1. InvalidArgument with the number of the vertex
// that is cut off, not a number or not finite.
absl::StatusOr<Model> ReadPlyPoints(const SourceFile& file, const PlyHeader& header);

}  // namespace voxeld::voxelctl
