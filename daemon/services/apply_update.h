// SceneService.ApplyUpdate apart from gRPC: a session of its own, opened, applied and closed.
#pragma once

#include <functional>

#include "absl/status/statusor.h"
#include "daemon/services/context.h"

namespace voxeld::v1 {
class ApplyUpdateRequest;
class ApplyUpdateResponse;
}  // namespace voxeld::v1

namespace voxeld::daemon::services {

// Fills `response`, which must live until `done` has been called, once,
// from the core's thread or from within.
void ApplyUpdate(ServiceContext& context, const v1::ApplyUpdateRequest& request,
                 v1::ApplyUpdateResponse* response, std::function<void(const absl::Status&)> done);

}  // namespace voxeld::daemon::services
