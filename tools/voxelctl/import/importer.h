// Reads a file into a model.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Whether voxelctl reads files of this extension (in lower case, without the dot) itself (OwnFormats). The others are read by the program voxeld-import (import_program.h).
bool IsOwnFormat(absl::string_view extension);

// Reads `path` by its extension, having checked that the contents are of that kind. Files, also folders, are read in a process of its own,
// with limits and in a sandbox (contained.h). Every index is in range and every number finite (samples may be no number) in what is
// returned, and it is not empty. `interrupt`, which may be null, ends the reading. An error's message begins with the path and says what
// was found and what would be right; Unimplemented if the file needs voxeld-import and there is none.
absl::StatusOr<Model> ImportFile(const std::string& path, const ImportOptions& options,
                                 Interrupt* interrupt = nullptr);

// Returns: InvalidArgument unless `model` is all that is promised above.
absl::Status CheckModel(const SourceFile& file, const Model& model);

// Reads a file of an own format in this process, and does not check the model.
absl::StatusOr<Model> ReadOwnFormat(const SourceFile& file, const ImportOptions& options);

}  // namespace voxeld::voxelctl
