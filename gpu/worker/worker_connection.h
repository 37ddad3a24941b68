// The connection to one engine's owner, at the worker's side: an engine of its own executes the
// owner's messages, one after another.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "gpu/worker/message.h"

namespace voxeld::gpu {

// The functions are called by all connections' threads.
struct WorkerHooks {
  // Creates the engine, which must execute calls inline.
  std::function<absl::StatusOr<std::unique_ptr<Engine>>(const EngineOptions&)> make_engine;
  // Called when a segment arrives, to pin it, or when it is dropped, to unpin it. May be empty.
  std::function<void(std::span<std::byte>)> pin, unpin;
  // The same for bulk memory, which cannot be written; `unpin` undoes it.
  std::function<void(std::span<std::byte>)> pin_read_only;
};

// Thread-bound.
class WorkerConnection {
 public:
  virtual ~WorkerConnection() = default;
  // Executes a message and sends its answer; takes or closes its descriptor. A status that is not
  // OK ends the worker: Unavailable (the owner is gone), DataLoss (the engine is lost; the owner
  // has been notified), or another code for a protocol error.
  virtual absl::Status Handle(Message& message) = 0;
};

// Answers are sent to `socket`, which the caller keeps. `hooks` must outlive the connection.
std::unique_ptr<WorkerConnection> NewWorkerConnection(int socket, const WorkerHooks& hooks);

}  // namespace voxeld::gpu
