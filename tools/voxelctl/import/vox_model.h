// MagicaVoxel's scenes (.vox; the format is its author's "MagicaVoxel-file-format-vox", with its extension).
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Voxels as cubes of length 1, of which the faces that no other voxel of their model hides are triangles in the
// palette's colours; models where the scene's nodes put and turn them, the first frame of each; hidden nodes are left out. A
// file without nodes has its models at one place. InvalidArgument names the chunk that is wrong.
absl::StatusOr<Model> ReadVoxModel(const SourceFile& file);

}  // namespace voxeld::voxelctl
