// The file formats that VOXELD_IMPORTERS adds. Where it is off, importers_not_built.cc answers for them, and for OpenAnimation.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Returns: OK, or Unimplemented "SUBJECT: …" with the option that adds the importers.
absl::Status CheckImporters(absl::string_view subject);

// Reads a file whose extension ImportFile does not read itself: DICOM also by its contents, the rest by the extension. An
// extension that nothing reads is InvalidArgument with those that are read.
absl::StatusOr<Model> ReadMoreFormats(const SourceFile& file, const ImportOptions& options);

// Reads a folder, which is taken for slices of DICOM.
absl::StatusOr<Model> ReadFolder(const std::string& path);

}  // namespace voxeld::voxelctl
