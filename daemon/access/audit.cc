#include "daemon/access/audit.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace voxeld::daemon::access {
namespace {

// Whether it is a file that can be read, and its last line has no end.
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

absl::StatusOr<std::unique_ptr<Audit>> Audit::Open(const std::string& path, Logger* log) {
  std::unique_ptr<Audit> audit(new Audit(path, log));
  if (path.empty()) return audit;
  absl::StatusOr<Descriptor> file = audit->OpenFile();
  if (!file.ok()) return file.status();
  audit->Take(*std::move(file));
  return audit;
}

absl::StatusOr<Descriptor> Audit::OpenFile() const {
  Descriptor file(
      open(path_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640));
  if (!file.ok()) return absl::ErrnoToStatus(errno, absl::StrCat("the audit log ", path_));
  return file;
}

void Audit::Record(const std::string& who, const std::string& peer, const std::string& method,
                   const std::string& what, const absl::Status& result) {
  const std::string outcome =
      result.ok() ? "OK"
                  : absl::StrCat(absl::StatusCodeToString(result.code()), ": ", result.message());
  if (path_.empty()) {
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
  if (cut_) line.insert(0, "\n");
  const ssize_t written = write(file_.get(), line.data(), line.size());
  const int error = errno;
  const bool failed = written != static_cast<ssize_t>(line.size());
  if (failed && !failed_ && log_ != nullptr) {
    log_->Error("the audit log cannot be written",
                {{"file", path_},
                 {"why", written < 0 ? std::generic_category().message(error)
                                     : std::string("the disk is full")}});
  }
  if (written > 0) cut_ = failed;
  failed_ = failed;
}

void Audit::Reopen() {
  if (path_.empty()) return;
  absl::StatusOr<Descriptor> file = OpenFile();
  if (!file.ok()) {
    if (log_ != nullptr) {
      log_->Error("the audit log stays where it was",
                  {{"why", std::string(file.status().message())}});
    }
    return;
  }
  Take(*std::move(file));
}

void Audit::Take(Descriptor file) {
  const bool cut = EndsWithinALine(file.get());
  sync::MutexLock lock(mutex_);
  file_ = std::move(file);
  cut_ = cut;
}

}  // namespace voxeld::daemon::access
