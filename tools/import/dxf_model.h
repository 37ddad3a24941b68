// Reads DXF drawings as surfaces, lines and points.
//
// assimp reads DXF too, but it draws every other segment of a polyline, uses a colour table of its
// own, and neither rotates nor nests inserted blocks.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads an ASCII DXF: faces, lines, points, polylines of all kinds, circles, arcs, ellipses, solids
// and inserted blocks, in the colours of entities, layers and blocks. Counts entities of other
// types, hidden entities and those of paper space as left out. Errors: InvalidArgument if the file
// is binary, damaged or too large, or shows nothing.
absl::StatusOr<Model> ReadDxfModel(const SourceFile& file);

}  // namespace voxeld::voxelctl
