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

// Returns whether voxelctl itself reads files of this extension (in lower case, without the dot):
// see OwnFormats. The program voxeld-import reads the others (import_program.h).
bool IsOwnFormat(absl::string_view extension);

// Reads `path` by its extension, after checking that the contents are of that kind. Files and
// folders are read in a separate process, with limits and in a sandbox (contained.h). In the
// result, every index is in range and every number is finite (samples may be not-a-number), and it
// is not empty. `interrupt`, which may be null, ends the reading. Errors: the message begins with
// the path and says what was found and what would be valid; Unimplemented if the file needs
// voxeld-import and that is missing.
absl::StatusOr<Model> ImportFile(const std::string& path, const ImportOptions& options,
                                 Interrupt* interrupt = nullptr);

// Returns: InvalidArgument unless `model` has all the properties promised above.
absl::Status CheckModel(const SourceFile& file, const Model& model);

// Reads a file of one of our own formats in this process, and does not check the model.
absl::StatusOr<Model> ReadOwnFormat(const SourceFile& file, const ImportOptions& options);

}  // namespace voxeld::voxelctl
