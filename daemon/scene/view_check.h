// Checks whether a scene can be shown with another view.
#pragma once

#include "absl/status/status.h"
#include "daemon/scene/commit_applier.h"
#include "daemon/scene/draft.h"
#include "daemon/scene/operation.h"

namespace voxeld::daemon {

// Errors: FailedPrecondition with the entity and its position if an entity of `scene` would exceed
// limits.max_coordinate_voxels through `view`. Visits all layers, but the entities only of layers
// that may not fit.
absl::Status CheckView(const Draft& scene, const DisplayView& view, const Limits& limits);

}  // namespace voxeld::daemon
