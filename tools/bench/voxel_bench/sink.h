// The bare sink: a gRPC server that takes the same calls over the same settings as the daemon, counts what comes, and
// throws it away. What it reaches is what gRPC leaves to a daemon.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace voxeld::bench {

// Serves SceneService.Stream on `listen` until its standard output's reader is gone or a signal
// ends it; says "ready ADDRESS…" with the ports that were chosen. A stream is answered when it is half-closed: by one StreamResponse whose
// credit_bytes is the sum of the bytes of its messages, and OK.
absl::Status RunSink(const std::vector<std::string>& listen);

}  // namespace voxeld::bench
