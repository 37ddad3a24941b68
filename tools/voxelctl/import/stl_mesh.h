// Reads triangles from stereolithography files (.stl), ASCII or binary.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads all solids of `file` as one model. A file is binary if its size fits the declared number of
// triangles, whatever its header begins with; bytes after the triangles are ignored. Colors are
// those of VisCAM and SolidView (bit 15 of the attribute set, red in bits 10 to 14), or of
// Materialise Magics ("COLOR=" in the header, bit 15 clear, red in bits 0 to 4). Normals are the
// file's, or otherwise computed from the winding. Facets of ASCII files may have more than three
// vertices, and are assumed to be convex.
//
// Returns: InvalidArgument with the invalid facet or line, or with both sizes of a truncated file.
absl::StatusOr<Model> ReadStlMesh(const SourceFile& file);

}  // namespace voxeld::voxelctl
