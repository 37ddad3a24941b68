// Silences gRPC's own messages on standard error, which repeat the errors of calls in gRPC's words.
#pragma once

namespace voxeld::voxelctl {

// Suppresses these messages from now on, except for assertions that terminate the process. Set
// GRPC_VERBOSITY to see them. Requires: called before gRPC is used.
void QuietGrpc();

}  // namespace voxeld::voxelctl
