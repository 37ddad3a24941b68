// Records actions that affect other clients: control actions and rejected calls. Each entry is a
// JSON object on its own line, appended to a separate file. Without a file, entries are lines of
// the daemon's log.
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
  std::string error;     // from the last write; empty: it succeeded
};

// Thread-safe. Arguments may contain any bytes; bytes that are not text are escaped.
//
// If the file cannot be written, entries stay in a bounded buffer and are written in order by a
// later Record, Retry or Reopen. Entries that do not fit into the buffer are counted as lost.
class Audit {
 public:
  // Creates the file with mode 0640 if needed. `log` may be null; otherwise it must outlive this
  // object.
  static absl::StatusOr<std::unique_ptr<Audit>> Open(AuditOptions options, Logger* log);

  // Call before each control action. Errors: Unavailable with the reason if entries are required
  // and the file cannot be written.
  absl::Status MayAct();

  void Record(const std::string& who, const std::string& peer, const std::string& method,
              const std::string& what, const absl::Status& result);

  // Writes pending entries. Call periodically.
  void Retry();

  // Opens the file again, after logrotate has moved it. If that fails, this is logged and the old
  // file stays open.
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
  // Entries were lost since the file could last be written.
  bool losing_ VOXELD_GUARDED_BY(mutex_) = false;
  std::string error_ VOXELD_GUARDED_BY(mutex_);  // from the last write; empty: it succeeded
  bool cut_ VOXELD_GUARDED_BY(mutex_) = false;   // the file ends in the middle of a line
};

}  // namespace voxeld::daemon::access
