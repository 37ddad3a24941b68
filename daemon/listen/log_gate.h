// Limits log lines whose number clients control: writes at most a few per second and counts the
// dropped ones.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::listen {

// Thread-safe.
class LogGate {
 public:
  static constexpr uint32_t kLinesPerSecond = 10;

  // `clock` and `log` must outlive the gate; `log` may be null.
  LogGate(sync::Clock& clock, Logger* log) : clock_(clock), log_(log) {}

  void Log(Logger::Level level, std::string_view event, const std::string& peer,
           const std::string& why) {
    if (log_ == nullptr) return;
    uint64_t left_out = 0;
    {
      sync::MutexLock lock(mutex_);
      const sync::TimeNs now = clock_.Now();
      if (now - since_ >= sync::kSecond) {
        since_ = now;
        lines_ = 0;
      }
      if (lines_ >= kLinesPerSecond) {
        ++left_out_;
        return;
      }
      ++lines_;
      left_out = std::exchange(left_out_, 0);
    }
    if (left_out == 0) return log_->Log(level, event, {{"peer", peer}, {"why", why}});
    log_->Log(level, event,
              {{"peer", peer}, {"why", why}, {"lines_left_out", absl::StrCat(left_out)}});
  }

 private:
  sync::Clock& clock_;
  Logger* const log_;
  sync::Mutex mutex_;
  sync::TimeNs since_ VOXELD_GUARDED_BY(mutex_) = -sync::kSecond;
  uint32_t lines_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t left_out_ VOXELD_GUARDED_BY(mutex_) = 0;
};

}  // namespace voxeld::daemon::listen
