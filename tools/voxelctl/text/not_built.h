// The error for a part that this build leaves out (cmake/VoxeldParts.cmake).
#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Returns: Unimplemented "SUBJECT: this build STATE; to add PART, run in the source tree:
// COMMANDS", where the commands install what OPTION needs, configure with it and build.
absl::Status NotBuilt(absl::string_view subject, absl::string_view state, absl::string_view part,
                      absl::string_view option);

}  // namespace voxeld::voxelctl
