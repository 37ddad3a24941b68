// The part of a scene that outlives its clients: layers of sessions that keep them, and the objects of
// their owners.
#pragma once

#include "daemon/scene/snapshot.h"

namespace voxeld::daemon::state {

// Layers and objects alone, with the snapshot's number. Shares what it has with `snapshot`, so that the
// difference of two views costs what differs.
SnapshotPtr KeptView(const SnapshotPtr& snapshot);

}  // namespace voxeld::daemon::state
