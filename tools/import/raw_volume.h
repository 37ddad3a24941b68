// Volumes that are nothing but samples (.raw): what they are has to be told.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Cubes of length 1, z up. InvalidArgument if nothing is told, or the file does not have just as many bytes.
absl::StatusOr<Model> ReadRawVolume(const SourceFile& file, const std::optional<RawLayout>& layout);

}  // namespace voxeld::voxelctl
