// Serialises a model, or the error of reading it. The confined reader of a file (contained.h) writes these bytes.
#pragma once

#include <cstddef>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Returns: whether all of it could be written.
bool WriteModel(const absl::StatusOr<Model>& model, int descriptor);

// Returns: the model that was written. A hostile file may control the writer, so enumerations and sizes are checked; ImportFile checks the
// rest (CheckModel). Errors: the one that was written, with a code that readers use; InvalidArgument if WriteModel cannot have written the
// bytes.
absl::StatusOr<Model> ReadModel(const SourceFile& file, const char* bytes, size_t size);

// InvalidArgument that says what became of the reader.
absl::Status Spoilt(const SourceFile& file, absl::string_view how);

}  // namespace voxeld::voxelctl
