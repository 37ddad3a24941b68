// The only place that converts a Status to gRPC's. Both use the same code numbers.
#pragma once

#include "absl/status/status.h"

namespace grpc {
class Status;
}

namespace voxeld::daemon::services {

// Truncates the message so that it fits into the trailing metadata.
grpc::Status ToGrpc(const absl::Status& status);

}  // namespace voxeld::daemon::services
