// Parses JSON of untrusted files.
#pragma once

#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// `text` is all or a part of `file`. Errors: InvalidArgument with what is wrong, and at which byte
// or depth.
absl::StatusOr<nlohmann::json> ParseJson(const SourceFile& file, absl::string_view text);

}  // namespace voxeld::voxelctl
