// Reads MagicaVoxel's scenes (.vox; the format is described by its author in
// "MagicaVoxel-file-format-vox", with its extension).
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads voxels as cubes of length 1. The faces that no other voxel of their model hides become
// triangles in the palette's colours. Models are placed and rotated by the scene's nodes, in the
// first frame of each; hidden nodes are left out. In a file without nodes, all models are at the
// same place. Errors: InvalidArgument with the invalid chunk.
absl::StatusOr<Model> ReadVoxModel(const SourceFile& file);

}  // namespace voxeld::voxelctl
