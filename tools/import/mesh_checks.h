// Checks of mesh files before the library that reads them: a wrong name, a truncated file, counts
// that do not fit, indices out of range. Each takes the file as read and touches nothing else.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// The check that a file has to pass before assimp sees it, by its extension.
absl::Status CheckMeshFile(const SourceFile& file);

// Wavefront OBJ: is text, has vertices, and no face, line or point
// refers to a vertex that is not there.
absl::Status CheckObj(const SourceFile& file);

// glTF text or GLB: well-formed, nested less than 64 deep; nodes form a forest;
// accessors lie within their views, views within their buffers;
// extensions that it requires are ones that can be read.
absl::Status CheckGltf(const SourceFile& file);

}  // namespace voxeld::voxelctl
