// Selects the reader for a file.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/format.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads a file in this process. DICOM is also recognised by its contents; other formats, including
// those that voxelctl reads itself, by their extension. Does not check the model (see CheckModel).
// Errors: InvalidArgument for an unknown extension; the message lists the known ones.
absl::StatusOr<Model> ReadAny(const SourceFile& file, const ImportOptions& options);

// Returns all formats that can be read, including those that voxelctl reads itself.
std::vector<Format> AllFormats();

// Reads a folder, whose files are taken as slices of DICOM.
absl::StatusOr<Model> ReadFolder(const std::string& path);

// Opens an animation in this process (OpenAnimation in tools/voxelctl/import/import_program.h).
absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimationHere(SourceFile file, size_t number,
                                                               double fps);

}  // namespace voxeld::voxelctl
