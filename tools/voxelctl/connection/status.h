// gRPC's statuses as ours.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "voxeld/credentials.h"

namespace grpc {
class Status;
}

namespace voxeld::voxelctl {

// The server's words are escaped; an Unavailable names `address`.
absl::Status FromGrpc(const grpc::Status& status, const std::string& address);

// Why there is no connection to `address`, from what gRPC says of it.
std::string WhyUnreachable(absl::string_view grpc_says, const std::string& address,
                           const client::Credentials& credentials);

// "cannot reach voxeld at ADDRESS (WHY); start it …".
absl::Status Unreachable(const std::string& address, const std::string& why);

}  // namespace voxeld::voxelctl
