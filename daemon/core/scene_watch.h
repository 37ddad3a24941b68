// Where those who watch the scene find its newest snapshot, and are told of the next.
//
// Each asks when it is ready for more, so one that is slow misses what lies between: nothing is
// kept for it. Thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "daemon/scene/snapshot.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

using SnapshotWaitId = uint64_t;

class SceneWatch {
 public:
  explicit SceneWatch(SnapshotPtr first) : newest_(std::move(first)) {}

  SnapshotPtr newest() const;

  // Calls `newer` once when there is a snapshot beyond `number`: in the thread that publishes it,
  // or in this one, before it returns, if there is already. `newer` must only post.
  // Answers are ascending, from 1.
  SnapshotWaitId Await(uint64_t number, std::function<void()> newer);
  // Drops what waits under `id`, if anything does; a call that is under way in another thread may
  // still end after this.
  void Cancel(SnapshotWaitId id);

  // `newest` is beyond the one before.
  void Publish(SnapshotPtr newest);

 private:
  mutable sync::Mutex mutex_;
  SnapshotPtr newest_ VOXELD_GUARDED_BY(mutex_);
  SnapshotWaitId next_id_ VOXELD_GUARDED_BY(mutex_) = 1;
  std::map<SnapshotWaitId, std::function<void()>> waiting_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon
