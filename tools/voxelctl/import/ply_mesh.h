// Surfaces from PLY: files with faces or strips of triangles.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Whether `header` announces faces or strips.
bool HasPlySurfaces(const PlyHeader& header);

// Requires: `header` is of `file`, and has vertices and surfaces. Elements may come in any order, and other elements are passed over.
// Polygons become triangles (triangulate.h); a strip's −1 begins a new one. Normals are the file's, or the mean of the faces around
// a vertex that lie within 50 degrees of each other. A face's color goes before its vertices'.
// Returns: InvalidArgument with the face or the vertex that is wrong.
absl::StatusOr<Model> ReadPlyMesh(const SourceFile& file, const PlyHeader& header,
                                  bool attributes = false);

}  // namespace voxeld::voxelctl
