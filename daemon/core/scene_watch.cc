#include "daemon/core/scene_watch.h"

#include <utility>

namespace voxeld::daemon {

SnapshotPtr SceneWatch::newest() const {
  sync::MutexLock lock(mutex_);
  return newest_;
}

SnapshotWaitId SceneWatch::Await(uint64_t number, std::function<void()> newer) {
  SnapshotWaitId id = 0;
  {
    sync::MutexLock lock(mutex_);
    id = next_id_++;
    if (newest_->number <= number) {
      waiting_.emplace(id, std::move(newer));
      return id;
    }
  }
  newer();
  return id;
}

void SceneWatch::Cancel(SnapshotWaitId id) {
  std::function<void()> dropped;  // destroyed without the lock
  sync::MutexLock lock(mutex_);
  const auto it = waiting_.find(id);
  if (it == waiting_.end()) return;
  dropped = std::move(it->second);
  waiting_.erase(it);
}

void SceneWatch::Publish(SnapshotPtr newest) {
  // Nobody waits for more than the next: whoever does has seen the newest.
  std::map<SnapshotWaitId, std::function<void()>> told;
  {
    sync::MutexLock lock(mutex_);
    newest_.swap(newest);  // the old one goes without the lock
    told.swap(waiting_);
  }
  for (const auto& [id, newer] : told) newer();
}

}  // namespace voxeld::daemon
