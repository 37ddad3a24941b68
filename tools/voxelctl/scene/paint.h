// Colours of a picture at vertices.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// Returns: the part without its picture, each colour multiplied by the texel at its vertex. The part has colours and places on the
// picture, a PNG or JPEG file. Between vertices the picture is lost. Errors: InvalidArgument if the picture cannot be read.
absl::StatusOr<Part> PaintVertices(const Part& part, const std::string& picture);

}  // namespace voxeld::voxelctl
