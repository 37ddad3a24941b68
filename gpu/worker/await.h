// Waits for an answer that arrives by a call.
#pragma once

#include <optional>
#include <utility>

#include "display/sync/mutex.h"

namespace voxeld::gpu {

// Returns the value, a Result, with which ask(answer) has `answer` called, once: from any thread,
// or inside `ask`. Blocks until then.
template <typename Result, typename AskFor>
Result Await(AskFor&& ask) {
  struct Box {
    sync::Mutex mutex;
    sync::CondVar changed;
    std::optional<Result> result VOXELD_GUARDED_BY(mutex);
  };
  Box box;
  ask([&box](Result result) {
    sync::MutexLock lock(box.mutex);
    box.result = std::move(result);
    box.changed.NotifyAll();
  });
  sync::MutexLock lock(box.mutex);
  while (!box.result.has_value()) box.changed.Wait(box.mutex);
  return *std::move(box.result);
}

}  // namespace voxeld::gpu
