// Extracts the persistent part of a scene: layers of sessions that keep them, and their owners'
// objects.
#pragma once

#include "daemon/scene/snapshot.h"

namespace voxeld::daemon::state {

// Returns: a snapshot of these layers and objects only, with the same number. It shares data with
// `snapshot`, so that computing the difference of two views costs only as much as they differ.
SnapshotPtr KeptView(const SnapshotPtr& snapshot);

}  // namespace voxeld::daemon::state
