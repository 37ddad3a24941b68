// Images of medicine (.dcm, or a folder of slices; DICOM).
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// All frames of one file as a volume.
absl::StatusOr<Model> ReadDicomVolume(const SourceFile& file);

// The slices in a folder, in the order in which they lie along their normal; of several series the one with the most, and said,
// as is what is no DICOM. InvalidArgument if they differ in size or orientation.
absl::StatusOr<Model> ReadDicomFolder(const std::string& path);

}  // namespace voxeld::voxelctl
