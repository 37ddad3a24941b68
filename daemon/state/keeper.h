// Writes the persistent part of the newest snapshot to disk, as the difference from the file's
// content, in one transaction. Commits that arrive during a transaction are combined into the next
// one, so that many durable commits cost one sync.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "daemon/core/state_sink.h"
#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "daemon/state/state_file.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::state {

struct KeeperOptions {
  // Longest delay before changes that no client waits for are written.
  sync::TimeNs interval_ns = 100 * sync::kMillisecond;
  // Interval between retries after a failure.
  sync::TimeNs retry_ns = sync::kSecond;
  // Returns: the wall clock in Unix nanoseconds at `now`, which was just read from the keeper's
  // clock.
  std::function<int64_t(sync::TimeNs now)> unix_ns;
  Logger* log = nullptr;  // outlives the keeper; may be null
};

// Thread-safe. Runs its own thread.
class Keeper final : public StateSink {
 public:
  // The clock must outlive the keeper. The first snapshot replaces the file's content; after Knows,
  // only its difference is written.
  Keeper(std::unique_ptr<StateFile> file, KeeperOptions options, sync::Clock& clock);
  ~Keeper() override;
  Keeper(const Keeper&) = delete;
  Keeper& operator=(const Keeper&) = delete;

  // Declares that the file contains exactly the persistent part of this snapshot, which was read
  // from it. Call before any Offer.
  void Knows(const SnapshotPtr& snapshot, OwnerRecords owners);

  // Sets the callback that reports, on the keeper's thread and after each transaction, the snapshot
  // that is on the disk.
  void SetOnDurable(std::function<void(uint64_t snapshot)> on_durable);

  void Offer(SnapshotPtr snapshot, std::shared_ptr<const OwnerRecords> owners,
             bool at_once) override;

  // Writes the last offered snapshot, unless writing fails, and closes the file. Returns: OK if
  // everything is on the disk.
  absl::Status Stop();

  StateFigures figures() const;

 private:
  struct Target {
    SnapshotPtr snapshot;
    std::shared_ptr<const OwnerRecords> owners;
  };
  void Run();
  absl::Status Write(const Target& target);
  void Report(const absl::Status& status) VOXELD_REQUIRES(mutex_);

  std::unique_ptr<StateFile> file_;  // used by the thread only, until it ends
  const KeeperOptions options_;
  sync::Clock& clock_;

  // Content of the file. Used by the thread only, after the first Offer.
  SnapshotPtr written_;  // a persistent view; null: unknown, so everything is written
  OwnerRecords written_owners_;

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  std::function<void(uint64_t)> on_durable_ VOXELD_GUARDED_BY(mutex_);
  Target offered_ VOXELD_GUARDED_BY(mutex_);  // newer than the snapshot being written; else null
  sync::TimeNs due_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  absl::Status last_ VOXELD_GUARDED_BY(mutex_);
  StateFigures figures_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace voxeld::daemon::state
