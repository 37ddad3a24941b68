#include "daemon/access/audit.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace voxeld::daemon::access {
namespace {

// Returns: whether the file is readable and its last line is incomplete.
bool EndsWithinALine(int file) {
  const Descriptor reader(open(absl::StrCat("/proc/self/fd/", file).c_str(),
                               O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  char last = '\n';
  const off_t end = lseek(reader.get(), 0, SEEK_END);
  if (end > 0) [[maybe_unused]]
    const ssize_t got = pread(reader.get(), &last, 1, end - 1);
  return last != '\n';
}

}  // namespace

absl::StatusOr<std::unique_ptr<Audit>> Audit::Open(AuditOptions options, Logger* log) {
  std::unique_ptr<Audit> audit(new Audit(std::move(options), log));
  if (audit->options_.path.empty()) return audit;
  absl::StatusOr<Descriptor> file = audit->OpenFile();
  if (!file.ok()) return file.status();
  audit->Take(*std::move(file));
  return audit;
}

absl::StatusOr<Descriptor> Audit::OpenFile() const {
  Descriptor file(
      open(options_.path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640));
  if (!file.ok()) return absl::ErrnoToStatus(errno, absl::StrCat("the audit log ", options_.path));
  return file;
}

absl::Status Audit::MayAct() {
  if (!options_.required || options_.path.empty()) return absl::OkStatus();
  sync::MutexLock lock(mutex_);
  if (!error_.empty()) WritePending();
  if (error_.empty()) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("the audit log ", options_.path, " cannot be written (", error_,
                   "), and log.audit_required refuses control actions until it can"));
}

void Audit::Record(const std::string& who, const std::string& peer, const std::string& method,
                   const std::string& what, const absl::Status& result) {
  const std::string outcome =
      result.ok() ? "OK"
                  : absl::StrCat(absl::StatusCodeToString(result.code()), ": ", result.message());
  if (options_.path.empty()) {
    if (log_ != nullptr) {
      log_->Info(
          "audit",
          {{"who", who}, {"peer", peer}, {"method", method}, {"what", what}, {"result", outcome}});
    }
    return;
  }
  const nlohmann::ordered_json entry = {
      {"time", absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::Now(), absl::UTCTimeZone())},
      {"who", who},
      {"peer", peer},
      {"method", method},
      {"what", what},
      {"result", outcome}};
  std::string line =
      entry.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  sync::MutexLock lock(mutex_);
  if (pending_bytes_ + line.size() > options_.max_pending_bytes) WritePending();
  if (!pending_.empty() && pending_bytes_ + line.size() > options_.max_pending_bytes) {
    ++lost_;
    if (!std::exchange(losing_, true) && log_ != nullptr) {
      log_->Error("audit entries are lost: the buffer is full", {{"file", options_.path}});
    }
    return;
  }
  pending_bytes_ += line.size();
  pending_.push_back(std::move(line));
  WritePending();
}

void Audit::WritePending() {
  while (!pending_.empty()) {
    const std::string line = cut_ ? "\n" + pending_.front() : pending_.front();
    const ssize_t written = write(file_.get(), line.data(), line.size());
    const int why = errno;
    const bool whole = written == static_cast<ssize_t>(line.size());
    if (written > 0) cut_ = !whole;
    if (!whole) {
      const bool first = error_.empty();
      error_ = written < 0 ? std::generic_category().message(why) : std::string("the disk is full");
      if (first && log_ != nullptr) {
        log_->Error("the audit log cannot be written", {{"file", options_.path}, {"why", error_}});
      }
      return;
    }
    pending_bytes_ -= pending_.front().size();
    pending_.pop_front();
  }
  if (!error_.empty() && log_ != nullptr) {
    log_->Info("the audit log is written again",
               {{"file", options_.path}, {"entries_lost", absl::StrCat(lost_)}});
  }
  error_.clear();
  losing_ = false;
}

void Audit::Retry() {
  sync::MutexLock lock(mutex_);
  if (!pending_.empty()) WritePending();
}

void Audit::Reopen() {
  if (options_.path.empty()) return;
  absl::StatusOr<Descriptor> file = OpenFile();
  if (!file.ok()) {
    if (log_ != nullptr) {
      log_->Error("the audit log stays where it was",
                  {{"why", std::string(file.status().message())}});
    }
    return;
  }
  Take(*std::move(file));
  Retry();
}

void Audit::Take(Descriptor file) {
  const bool cut = EndsWithinALine(file.get());
  sync::MutexLock lock(mutex_);
  file_ = std::move(file);
  cut_ = cut;
}

AuditStats Audit::stats() const {
  sync::MutexLock lock(mutex_);
  return {.pending = pending_.size(), .lost = lost_, .error = error_};
}

}  // namespace voxeld::daemon::access
