// The one place where a Status becomes gRPC's. The codes are the same numbers on both sides.
#pragma once

#include "absl/status/status.h"

namespace grpc {
class Status;
}

namespace voxeld::daemon::services {

// The message is cut to what fits the trailing metadata.
grpc::Status ToGrpc(const absl::Status& status);

}  // namespace voxeld::daemon::services
