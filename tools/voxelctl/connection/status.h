// Converts gRPC's statuses.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "voxeld/credentials.h"

namespace grpc {
class Status;
}

namespace voxeld::voxelctl {

// Escapes the server's message; an Unavailable names `address`.
absl::Status FromGrpc(const grpc::Status& status, const std::string& address);

// Returns why `address` cannot be reached, derived from gRPC's message.
std::string WhyUnreachable(absl::string_view grpc_says, const std::string& address,
                           const client::Credentials& credentials);

// Returns "cannot reach voxeld at ADDRESS (WHY); start it …".
absl::Status Unreachable(const std::string& address, const std::string& why);

}  // namespace voxeld::voxelctl
