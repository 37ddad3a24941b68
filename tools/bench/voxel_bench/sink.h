// The bare sink: a gRPC server that accepts the same calls with the same settings as the daemon,
// counts the received bytes and discards them. Its throughput is the upper bound that gRPC leaves
// to a daemon.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace voxeld::bench {

// Serves SceneService.Stream on `listen` until the reader of its standard output exits or a signal
// arrives. It prints "ready ADDRESS…" with the chosen ports. When a stream is half-closed, it is
// answered with OK and one StreamResponse whose credit_bytes is the sum of the bytes of its
// messages.
absl::Status RunSink(const std::vector<std::string>& listen);

}  // namespace voxeld::bench
