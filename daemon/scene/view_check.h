// Whether a scene can be shown through another view.
#pragma once

#include "absl/status/status.h"
#include "daemon/scene/commit_applier.h"
#include "daemon/scene/draft.h"
#include "daemon/scene/operation.h"

namespace voxeld::daemon {

// FailedPrecondition, with the entity and where it would lie, if one of `scene` would be beyond
// limits.max_coordinate_voxels through `view`. Costs the layers; the entities only of those layers
// that may not fit.
absl::Status CheckView(const Draft& scene, const DisplayView& view, const Limits& limits);

}  // namespace voxeld::daemon
