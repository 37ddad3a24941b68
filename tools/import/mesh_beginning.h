// Checks how files of meshes that assimp reads must begin.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Counts the colours of an OFF file that assimp ignores.
struct OffColors {
  uint64_t faces = 0;
  uint64_t vertices = 0;  // of a file whose header does not announce them
};
OffColors CountOffColors(const SourceFile& file);

// Checks the beginning of a file. An .off, .fbx, .3mf, .dae, .blend, .ifc or .bvh must begin as its
// format requires and have at most 512 MiB, an .off must have the faces that it declares, and an
// .ifc must define the entities that it refers to. Other files are accepted. Errors:
// InvalidArgument otherwise.
absl::Status CheckMeshBeginning(const SourceFile& file);

}  // namespace voxeld::voxelctl
