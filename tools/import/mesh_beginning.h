// Files of meshes that assimp reads: how they must begin.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// InvalidArgument unless an .off, .fbx, .3mf, .dae, .blend, .ifc or .bvh begins as such a file does and has 512 MiB at most, an .off has
// the faces that it declares, and an .ifc defines what it refers to. Others may begin as they like.
absl::Status CheckMeshBeginning(const SourceFile& file);

}  // namespace voxeld::voxelctl
