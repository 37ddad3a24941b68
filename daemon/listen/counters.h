// What the listener counts, for the statistics.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <utility>

#include "daemon/core/stats.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::listen {

// Thread-safe. Lives as long as whoever reads it; the listener may be gone.
class Counters {
 public:
  using Count = std::atomic<uint64_t>;
  Count open = 0;
  Count accepted = 0;
  Count refused_in_all = 0, refused_by_address = 0, refused_after_cut = 0;
  Count cut_for_bytes = 0, cut_for_time = 0, cut_for_cancelling = 0;
  Count cut_for_greeting = 0, cut_for_flooding = 0;
  Count accept_failures = 0;
  Count probe_failures = 0;
  Count calls_turned_away = 0, calls_revoked = 0;

  // Why nobody can connect, as the probe sees it; empty: all is well.
  void SetUnreachable(std::string why) {
    sync::MutexLock lock(mutex_);
    unreachable_ = std::move(why);
  }

  ListenFigures Read() const {
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
                      .accept_failures = accept_failures,
                      .probe_failures = probe_failures,
                      .calls_turned_away = calls_turned_away,
                      .calls_revoked = calls_revoked};
    sync::MutexLock lock(mutex_);
    out.unreachable = unreachable_;
    return out;
  }

 private:
  mutable sync::Mutex mutex_;
  std::string unreachable_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::listen
