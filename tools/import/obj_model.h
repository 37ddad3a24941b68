// Reads Wavefront OBJ, with the materials of .mtl files.
//
// tinyobjloader parses numbers, references and materials in double precision. assimp uses single
// precision, in which the coordinates of a survey are half a metre apart. tinyobjloader is a header
// without dependencies. This reader gives it the statements one by one, because the library on its
// own ends names at a blank, loses or repeats lines and points beside faces, truncates faces at 255
// corners, supports vertex colours only in the interface that does not stream, and reads words that
// are not numbers as 0. It opens no file: ReadOtherFile does.
//
// The following are not shown but counted: free-form curves and surfaces, transparency, maps other
// than map_Kd, pictures that are neither PNG nor JPEG, and unknown statements.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Errors: InvalidArgument with the line, what is wrong in it, and what was expected.
absl::StatusOr<Model> ReadObjModel(const SourceFile& file);

}  // namespace voxeld::voxelctl
