// Wavefront OBJ, with the materials of .mtl files.
//
// tinyobjloader parses numbers, references and materials in double precision: assimp keeps single precision, in which the coordinates of a survey
// are half a metre apart. It is a header without dependencies. This reader gives it the statements one by one, because the library by itself ends
// names at a blank, loses lines and points beside faces or repeats them, cuts faces at 255 corners, has colours of vertices only in the interface
// that does not stream, and reads what is not a number as 0. It opens no file: ReadOtherFile does.
//
// Not shown, and counted: free-form curves and surfaces, transparency, maps other than map_Kd, pictures that are neither PNG nor JPEG, statements that
// are not known.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// InvalidArgument: the line, what is wrong in it, and what is expected.
absl::StatusOr<Model> ReadObjModel(const SourceFile& file);

}  // namespace voxeld::voxelctl
