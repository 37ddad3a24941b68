// Drawings (.svg; "Scalable Vector Graphics 1.1").
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// The outlines of paths and shapes under their transforms, as lines in the colours of their strokes, or else of their fills;
// upright, in the plane where z is 0 before the model is turned. Symbols are drawn where they are used. Texts, pictures, clips and masks are
// left out, and said. Entities and whatever lies elsewhere are not looked up. InvalidArgument with the line's number.
absl::StatusOr<Model> ReadSvgLines(const SourceFile& file);

}  // namespace voxeld::voxelctl
