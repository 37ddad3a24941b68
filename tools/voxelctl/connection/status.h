// gRPC's statuses as ours.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace grpc {
class Status;
}

namespace voxeld::voxelctl {

// The server's words are escaped; an Unavailable names `address`.
absl::Status FromGrpc(const grpc::Status& status, const std::string& address);

// "cannot reach voxeld at ADDRESS (WHY); start it …".
absl::Status Unreachable(const std::string& address, const std::string& why);

}  // namespace voxeld::voxelctl
