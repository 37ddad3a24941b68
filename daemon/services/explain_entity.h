// SceneService.ExplainEntity apart from gRPC.
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "daemon/services/context.h"

namespace voxeld::v1 {
class ExplainEntityRequest;
class ExplainEntityResponse;
}  // namespace voxeld::v1

namespace voxeld::daemon::services {

// Called once, or never if the server ends first; from the core's thread, the explainer's, or from within. The response
// holds if the status is OK.
using ExplainDone = std::function<void(const absl::Status&, const v1::ExplainEntityResponse&)>;

// ResourceExhausted if as many wait as may.
void ExplainEntity(ServiceContext& context, const v1::ExplainEntityRequest& request,
                   ExplainDone done);

}  // namespace voxeld::daemon::services
