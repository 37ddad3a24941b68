#include "tools/voxelctl/connection/status.h"

#include <grpcpp/support/status.h>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {

absl::Status FromGrpc(const grpc::Status& status, const std::string& address) {
  if (status.ok()) return absl::OkStatus();
  const std::string message = EscapeForTerminal(status.error_message());
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    return absl::UnavailableError(
        absl::StrCat("voxeld at ", address, " is not available: ", message));
  }
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
    return absl::DeadlineExceededError(
        absl::StrCat("voxeld at ", address, " did not answer in time: ", message));
  }
  return {static_cast<absl::StatusCode>(status.error_code()), message};
}

absl::Status Unreachable(const std::string& address, const std::string& why) {
  return absl::UnavailableError(
      absl::StrCat("cannot reach voxeld at ", EscapeForTerminal(address), " (", why,
                   "); start it with `voxeld`, or say where it is with --server or "
                   "VOXELD_SERVER"));
}

}  // namespace voxeld::voxelctl
