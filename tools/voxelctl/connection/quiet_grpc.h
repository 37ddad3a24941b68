// gRPC's own lines on standard error say again, in its words, what the error of a call says in ours.
#pragma once

namespace voxeld::voxelctl {

// From now on they are left out, but for the assertion that ends the process. Who wants them sets GRPC_VERBOSITY. To be
// called before gRPC is used.
void QuietGrpc();

}  // namespace voxeld::voxelctl
