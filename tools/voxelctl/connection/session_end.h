// Records how a lasting session ended, as reported on its own thread.
#pragma once

#include <atomic>

#include "absl/status/status.h"
#include "display/sync/mutex.h"
#include "voxeld/client.h"

namespace voxeld::voxelctl {

// Thread-safe.
class SessionEnd {
 public:
  // Handles client::Options::on_connection.
  void Told(const client::ConnectionChange& change) {
    if (change.kind != client::ConnectionChange::Kind::kEnded) return;
    const sync::MutexLock lock(mutex_);
    status_ =
        change.status.ok() ? absl::UnavailableError("the server ended the session") : change.status;
    ended_.store(true);
  }
  bool ended() const { return ended_.load(); }
  // Returns the reason; OK as long as the session has not ended.
  absl::Status status() const {
    const sync::MutexLock lock(mutex_);
    return status_;
  }

 private:
  mutable sync::Mutex mutex_;
  absl::Status status_ VOXELD_GUARDED_BY(mutex_);
  std::atomic<bool> ended_ = false;
};

}  // namespace voxeld::voxelctl
