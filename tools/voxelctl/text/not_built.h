// The answer of a part that this build leaves out (cmake/VoxeldParts.cmake).
#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Returns: Unimplemented "SUBJECT: this build STATE; configure with -DOPTION=ON[ for WANTED]".
absl::Status NotBuilt(absl::string_view subject, absl::string_view state, absl::string_view option,
                      absl::string_view wanted = "");

}  // namespace voxeld::voxelctl
