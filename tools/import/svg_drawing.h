// Drawings (.svg; "Scalable Vector Graphics 1.1").
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// What paths and shapes fill, with its edge, and their strokes as lines; upright, in the plane where z is 0 before the model is
// turned, in levels (Part::level) as they are painted over each other. Symbols are drawn where they are used. Texts, pictures, clips and
// masks are left out, and said. Entities and whatever lies elsewhere are not looked up. InvalidArgument with the line's number.
absl::StatusOr<Model> ReadSvgDrawing(const SourceFile& file);

}  // namespace voxeld::voxelctl
