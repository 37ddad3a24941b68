// Who did what that others feel: control actions, and calls that were turned away. A JSON object a
// line, appended to a file of its own, or lines of the daemon's log where there is none.
//
//   {"time":"2026-01-31T12:00:00.000Z","who":"token stage-left","peer":"ipv4:192.0.2.1:4000",
//    "method":"UpdateDisplay","what":"name=\"sim\" brightness=0.5","result":"OK"}
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/access/access.h"
#include "daemon/address/descriptor.h"
#include "daemon/log/logger.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::access {

struct AuditOptions {
  std::string path;       // empty: entries go into the daemon's log
  bool required = false;  // refuse control actions while entries cannot be written
  size_t max_pending_bytes = size_t{1} << 20;
};

struct AuditStats {
  uint64_t pending = 0;  // entries that are not written yet
  uint64_t lost = 0;     // entries that did not fit into the buffer
  std::string error;     // of the last write; empty: it succeeded
};

// Thread-safe. Arguments may hold any bytes: those that are not text are escaped.
//
// If the file cannot be written, entries are kept in a bounded buffer and written in order by a later Record, Retry or Reopen. Entries
// that do not fit into the buffer are counted as lost.
class Audit {
 public:
  // The file is created with mode 0640. `log` may be null, and outlives this.
  static absl::StatusOr<std::unique_ptr<Audit>> Open(AuditOptions options, Logger* log);

  // Call before each control action. Returns: Unavailable with the reason if entries are required and the file cannot be written.
  absl::Status MayAct();

  void Record(const std::string& who, const std::string& peer, const std::string& method,
              const std::string& what, const absl::Status& result);

  // Writes pending entries. Call periodically.
  void Retry();

  // Opens the file again, after it was moved away (logrotate). If that fails, the log says so and the old file stays open.
  void Reopen();

  AuditStats stats() const;

 private:
  Audit(AuditOptions options, Logger* log) : options_(std::move(options)), log_(log) {}
  absl::StatusOr<Descriptor> OpenFile() const;
  void Take(Descriptor file);
  void WritePending() VOXELD_REQUIRES(mutex_);

  const AuditOptions options_;
  Logger* const log_;
  mutable sync::Mutex mutex_;
  Descriptor file_ VOXELD_GUARDED_BY(mutex_);
  std::deque<std::string> pending_ VOXELD_GUARDED_BY(mutex_);
  size_t pending_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t lost_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool losing_ VOXELD_GUARDED_BY(mutex_) =
      false;  // entries were lost since the file could last be written
  std::string error_ VOXELD_GUARDED_BY(mutex_);  // of the last write; empty: it succeeded
  bool cut_ VOXELD_GUARDED_BY(mutex_) = false;   // the file ends in the middle of a line
};

}  // namespace voxeld::daemon::access
