// The worker's side: carries out what comes over the socket, one call after another, until the
// socket ends.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

struct WorkerHooks {
  // Makes the engine; must carry out calls inline.
  std::function<absl::StatusOr<std::unique_ptr<Engine>>(const EngineOptions&)> make_engine;
  // A segment came, or goes: to be pinned. May be empty.
  std::function<void(std::span<std::byte>)> pin, unpin;
  // Before the n-th frame, from 1. May be empty.
  std::function<void(uint64_t)> before_frame;
};

// Returns the process' exit code: 0 when the socket ended, 1 if what came was no protocol, 3 when
// the engine was lost (which has been told).
int ServeEngine(int socket, const WorkerHooks& hooks);

// What a worker's main does first: outlives no parent, leaves signals to it.
void BecomeWorker();

}  // namespace voxeld::gpu
