// Writes down what outlives the daemon: the newest snapshot's kept part, as the difference from what the
// file has, in one transaction. Commits that come while one is under way go together into the next, so
// that many durable ones cost one sync.
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
  // What nobody waits for is written this long after it came, at the latest.
  sync::TimeNs interval_ns = 100 * sync::kMillisecond;
  // After a failure it is tried again this often.
  sync::TimeNs retry_ns = sync::kSecond;
  // Returns: the wall clock in Unix nanoseconds at `now`, which was just read from the keeper's clock.
  std::function<int64_t(sync::TimeNs now)> unix_ns;
  Logger* log = nullptr;  // outlives the keeper; may be none
};

// Thread-safe. One thread of its own.
class Keeper final : public StateSink {
 public:
  // The clock outlives it. The first snapshot that comes is written whole, in place of what the file has;
  // or, after Knows, as what differs.
  Keeper(std::unique_ptr<StateFile> file, KeeperOptions options, sync::Clock& clock);
  ~Keeper() override;
  Keeper(const Keeper&) = delete;
  Keeper& operator=(const Keeper&) = delete;

  // The file has all that is kept of this snapshot, and nothing else: it was read from there. Before any
  // Offer.
  void Knows(const SnapshotPtr& snapshot, OwnerRecords owners);

  // On the keeper's thread, after each transaction: the snapshot that is on the disk.
  void SetOnDurable(std::function<void(uint64_t snapshot)> on_durable);

  void Offer(SnapshotPtr snapshot, std::shared_ptr<const OwnerRecords> owners,
             bool at_once) override;

  // Writes what was offered last, unless the file fails, and closes it. OK if all is on the disk.
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

  std::unique_ptr<StateFile> file_;  // the thread's, until it ends
  const KeeperOptions options_;
  sync::Clock& clock_;

  // What the file has; the thread's, once something was offered.
  SnapshotPtr written_;  // a kept view; null: not known, all is written
  OwnerRecords written_owners_;

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  std::function<void(uint64_t)> on_durable_ VOXELD_GUARDED_BY(mutex_);
  Target offered_ VOXELD_GUARDED_BY(mutex_);  // newer than what was taken; else null
  sync::TimeNs due_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  absl::Status last_ VOXELD_GUARDED_BY(mutex_);
  StateFigures figures_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace voxeld::daemon::state
