// Who did what that others feel: control actions, and calls that were turned away. A JSON object a
// line, appended to a file of its own, or lines of the daemon's log where there is none.
//
//   {"time":"2026-01-31T12:00:00.000Z","who":"token stage-left","peer":"ipv4:192.0.2.1:4000",
//    "method":"UpdateDisplay","what":"name=\"sim\" brightness=0.5","result":"OK"}
#pragma once

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

// Thread-safe. What it is told may be anything: bytes that are no text are escaped.
class Audit {
 public:
  // `path` empty: into `log`. The file is made with mode 0640. `log`, which may be none, outlives this.
  static absl::StatusOr<std::unique_ptr<Audit>> Open(const std::string& path, Logger* log);

  void Record(const std::string& who, const std::string& peer, const std::string& method,
              const std::string& what, const absl::Status& result);

  // Opens the file anew, where it was moved away (logrotate). What cannot be opened is said in the log,
  // and the old one stays.
  void Reopen();

 private:
  Audit(std::string path, Logger* log) : path_(std::move(path)), log_(log) {}
  absl::StatusOr<Descriptor> OpenFile() const;
  void Take(Descriptor file);

  const std::string path_;
  Logger* const log_;
  sync::Mutex mutex_;
  Descriptor file_ VOXELD_GUARDED_BY(mutex_);
  bool failed_ VOXELD_GUARDED_BY(mutex_) = false;  // the last line could not be written
  bool cut_ VOXELD_GUARDED_BY(mutex_) = false;     // the file ends in the midst of a line
};

}  // namespace voxeld::daemon::access
