#include "tools/voxelctl/connection/quiet_grpc.h"

#include <grpc/support/log.h>

#include <cstdio>
#include <cstdlib>

#include "absl/strings/match.h"

namespace voxeld::voxelctl {

void QuietGrpc() {
  if (std::getenv("GRPC_VERBOSITY") != nullptr) return;
  gpr_set_log_function([](gpr_log_func_args* line) {
    if (!absl::StrContains(line->message, "assertion failed")) return;
    (void)std::fprintf(stderr, "gRPC: %s\n", line->message);
  });
}

}  // namespace voxeld::voxelctl
