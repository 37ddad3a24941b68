// Implements SceneService.ApplyUpdate independently of gRPC: opens a session, applies the update
// and closes the session.
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

// Called exactly once, even if the core stops, on the core's thread or before ApplyUpdate returns.
// The response is valid if the status is OK.
using UpdateDone = std::function<void(const absl::Status&, const v1::ApplyUpdateResponse&)>;

// `slices` are the bytes of an ApplyUpdateRequest; they are read before the call returns.
void ApplyUpdate(ServiceContext& context, const access::Caller& caller,
                 std::span<const std::string_view> slices, UpdateDone done);

}  // namespace voxeld::daemon::services
