// Counts the listener's events for the statistics.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::listen {

// Thread-safe. Must outlive its readers; the listener may be destroyed earlier.
class Counters {
 public:
  using Count = std::atomic<uint64_t>;
  // How long Read reports that no connection could be accepted.
  static constexpr sync::TimeNs kTold = 60 * sync::kSecond;

  Count open = 0;
  Count accepted = 0;
  Count refused_in_all = 0, refused_by_address = 0, refused_after_cut = 0;
  Count cut_for_bytes = 0, cut_for_time = 0, cut_for_cancelling = 0;
  Count cut_for_greeting = 0, cut_for_flooding = 0, cut_for_room = 0;
  Count accept_failures = 0;
  Count probe_failures = 0;
  Count calls_turned_away = 0, calls_revoked = 0;

  // Sets why clients cannot connect, as found by the probe; empty: they can.
  void SetUnreachable(std::string why) {
    sync::MutexLock lock(mutex_);
    unreachable_ = std::move(why);
  }

  // Records that no connection could be accepted at `now`.
  void NoteAcceptFailure(sync::TimeNs now, std::string why) {
    ++accept_failures;
    sync::MutexLock lock(mutex_);
    accept_failed_ns_ = now;
    accept_failed_why_ = std::move(why);
  }

  // Returns: a function that records and logs why no connection can be accepted, for servers other
  // than the listener. All arguments and this object must outlive it.
  std::function<void(const std::string&)> Noting(sync::Clock& clock, Logger& log) {
    return [this, &clock, &log](const std::string& why) {
      NoteAcceptFailure(clock.Now(), why);
      log.Warn("no connection can be accepted",
               {{"why", why},
                {"of", "http"},
                {"hint", "raise LimitNOFILE or lower max_http_connections"}});
    };
  }

  // `now` is the time for accept_trouble; 0: leave it empty.
  ListenFigures Read(sync::TimeNs now = 0) const {
    ListenFigures out{.open = open,
                      .accepted = accepted,
                      .refused_in_all = refused_in_all,
                      .refused_by_address = refused_by_address,
                      .refused_after_cut = refused_after_cut,
                      .cut_for_bytes = cut_for_bytes,
                      .cut_for_time = cut_for_time,
                      .cut_for_cancelling = cut_for_cancelling,
                      .cut_for_greeting = cut_for_greeting,
                      .cut_for_flooding = cut_for_flooding,
                      .cut_for_room = cut_for_room,
                      .accept_failures = accept_failures,
                      .probe_failures = probe_failures,
                      .calls_turned_away = calls_turned_away,
                      .calls_revoked = calls_revoked};
    sync::MutexLock lock(mutex_);
    out.unreachable = unreachable_;
    if (!accept_failed_why_.empty() && now > 0 && now - accept_failed_ns_ < kTold) {
      out.accept_trouble = absl::StrCat(
          "no connection could be accepted ", (now - accept_failed_ns_) / sync::kSecond, " s ago (",
          out.accept_failures, " times since the start): ", accept_failed_why_);
    }
    return out;
  }

 private:
  mutable sync::Mutex mutex_;
  std::string unreachable_ VOXELD_GUARDED_BY(mutex_);
  std::string accept_failed_why_ VOXELD_GUARDED_BY(mutex_);  // empty: never failed
  sync::TimeNs accept_failed_ns_ VOXELD_GUARDED_BY(mutex_) = 0;
};

}  // namespace voxeld::daemon::listen
