// SceneService.ApplyUpdate apart from gRPC: a session of its own, opened, applied and closed.
#pragma once

#include <functional>
#include <span>
#include <string_view>

#include "absl/status/status.h"
#include "daemon/services/context.h"

namespace voxeld::v1 {
class ApplyUpdateResponse;
}  // namespace voxeld::v1

namespace voxeld::daemon::services {

// Called once, whatever becomes of the core; from the core's thread or from within. The response
// holds if the status is OK.
using UpdateDone = std::function<void(const absl::Status&, const v1::ApplyUpdateResponse&)>;

// `slices` are an ApplyUpdateRequest, read before the call returns.
void ApplyUpdate(ServiceContext& context, const access::Caller& caller,
                 std::span<const std::string_view> slices, UpdateDone done);

}  // namespace voxeld::daemon::services
