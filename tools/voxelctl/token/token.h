// voxelctl token: makes an unguessable token, and the entry of the grants file that admits it.
// Needs no daemon. Its output is the only place where the token exists.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// Writes only the token to standard output, so that it can be redirected to a file. The entry is
// printed as a message, or appended to TokenOptions::grants, which is created with mode 0600 if it
// does not exist and otherwise must be valid. With --json both are written as one object. Errors:
// InvalidArgument for an invalid name, scopes or days.
absl::Status MakeToken(const TokenOptions& options, Console& console);

}  // namespace voxeld::voxelctl
