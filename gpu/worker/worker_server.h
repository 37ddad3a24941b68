// The worker's side: an engine for each connection, on a thread of its own, which carries out what
// comes over that, one call after another, until it ends.
#pragma once

#include "gpu/worker/worker_connection.h"

namespace voxeld::gpu {

// Serves the connections that come over `control`. Ends the process, at once and whatever its
// engines do: with 0 when `control` ends, with 1 if what came was no protocol, with 3 when an engine
// was lost (its owner has been told; a GPU's fault is all its engines').
[[noreturn]] void ServeEngines(int control, const WorkerHooks& hooks);

// What a worker's main does first: leaves signals to its owner, and has a GPU's code made ready, and
// compiled if need be, before the first answer, for which there is more time.
void BecomeWorker();

}  // namespace voxeld::gpu
