// voxelctl token: a token that nobody can guess, and the entry of the grants file that lets it in. Needs no
// daemon; what it prints is the only place where the token ever is.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// The token on standard output, alone, so that it can go to a file; the entry as words, or appended to
// TokenOptions::grants, which is made with mode 0600 if it is not there and otherwise must be right. With
// --json both as one object. InvalidArgument for a name, scopes or days that there are not.
absl::Status MakeToken(const TokenOptions& options, Console& console);

}  // namespace voxeld::voxelctl
