// The worker's side: an engine for each connection, on a thread of its own, which executes the
// calls of that connection, one after another, until the connection ends.
#pragma once

#include "gpu/worker/worker_connection.h"

namespace voxeld::gpu {

// Serves the connections that arrive over `control`. Terminates the process, at once and whatever
// its engines do: with status 0 when `control` ends, with 1 after a protocol error, and with 3 when
// an engine was lost (its owner has been notified; a fault of a GPU affects all its engines).
[[noreturn]] void ServeEngines(int control, const WorkerHooks& hooks);

// The first step of a worker's main: leaves signals to its owner, and makes sure that a GPU's code
// is loaded, and compiled if necessary, before the first answer, for which there is more time.
void BecomeWorker();

}  // namespace voxeld::gpu
