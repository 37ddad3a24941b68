// Applies a picture's colours at vertices.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// Returns: the part without its picture, each colour multiplied by the texel at its vertex.
// Requires: the part has colours and texture coordinates on the picture, which is a PNG or JPEG
// file. Between vertices the picture is lost. Errors: InvalidArgument if the picture cannot be
// read.
absl::StatusOr<Part> PaintVertices(const Part& part, const std::string& picture);

}  // namespace voxeld::voxelctl
