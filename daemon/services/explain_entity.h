// Implements SceneService.ExplainEntity independently of gRPC.
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "daemon/services/context.h"

namespace voxeld::v1 {
class ExplainEntityRequest;
class ExplainEntityResponse;
}  // namespace voxeld::v1

namespace voxeld::daemon::services {

// Called once, or never if the server is destroyed first; on the core's or the explainer's thread,
// or before ExplainEntity returns. The response is valid if the status is OK.
using ExplainDone = std::function<void(const absl::Status&, const v1::ExplainEntityResponse&)>;

// Errors: ResourceExhausted if the queue is full.
void ExplainEntity(ServiceContext& context, const v1::ExplainEntityRequest& request,
                   ExplainDone done);

}  // namespace voxeld::daemon::services
