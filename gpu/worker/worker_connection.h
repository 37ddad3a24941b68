// One engine's owner, at the worker's side: what it sends, carried out message after message by an engine of its own.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "gpu/worker/message.h"

namespace voxeld::gpu {

// Called by all connections' threads.
struct WorkerHooks {
  // Makes the engine; must carry out calls inline.
  std::function<absl::StatusOr<std::unique_ptr<Engine>>(const EngineOptions&)> make_engine;
  // A segment came, or goes: to be pinned. May be empty.
  std::function<void(std::span<std::byte>)> pin, unpin;
  // The same of bulk memory, which cannot be written; `unpin` undoes it.
  std::function<void(std::span<std::byte>)> pin_read_only;
};

// Thread-bound.
class WorkerConnection {
 public:
  virtual ~WorkerConnection() = default;
  // Carries a message out and sends its answer; its descriptor is taken, or closed. What is not OK ends the worker:
  // Unavailable (the owner is gone), DataLoss (the engine is lost; the owner has been told), or else it was no protocol.
  virtual absl::Status Handle(Message& message) = 0;
};

// Answers go to `socket`, which stays the caller's. `hooks` outlive it.
std::unique_ptr<WorkerConnection> NewWorkerConnection(int socket, const WorkerHooks& hooks);

}  // namespace voxeld::gpu
