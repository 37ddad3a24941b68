// Reads surfaces from PLY: files with faces or triangle strips.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Returns whether `header` declares faces or strips.
bool HasPlySurfaces(const PlyHeader& header);

// Reads the surfaces. Requires: `header` is of `file`, and has vertices and surfaces. Elements may
// come in any order, and other elements are skipped. Polygons become triangles (triangulate.h); a
// strip's −1 begins a new one. Normals are the file's, or the mean of the faces around a vertex
// that differ by at most 50 degrees. A face's color overrides those of its vertices. Returns:
// InvalidArgument with the invalid face or vertex.
absl::StatusOr<Model> ReadPlyMesh(const SourceFile& file, const PlyHeader& header,
                                  bool attributes = false);

}  // namespace voxeld::voxelctl
