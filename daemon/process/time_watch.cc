#include "daemon/process/time_watch.h"

#include <ctime>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace voxeld::daemon {
namespace {

constexpr int kTries = 4;

sync::TimeNs Read(clockid_t clock) {
  timespec time = {};
  clock_gettime(clock, &time);
  return time.tv_sec * sync::kSecond + time.tv_nsec;
}

double Seconds(sync::TimeNs time) {
  return static_cast<double>(time) / static_cast<double>(sync::kSecond);
}

std::string Ago(sync::TimeNs time, uint64_t count) {
  std::string text = absl::StrCat(time / sync::kSecond, " s ago");
  if (count > 1) absl::StrAppend(&text, " (", count, " times since the start)");
  return text;
}

}  // namespace

TimeWatch::Reading TimeWatch::OfSystem() {
  Reading best;
  sync::TimeNs between = sync::kNever;
  for (int i = 0; i < kTries && between > sync::kMillisecond; ++i) {
    const sync::TimeNs before = Read(CLOCK_BOOTTIME);
    const sync::TimeNs wall = Read(CLOCK_REALTIME);
    const sync::TimeNs after = Read(CLOCK_BOOTTIME);
    if (after - before >= between) continue;
    between = after - before;
    best = {.running = after, .wall = wall};
  }
  return best;
}

TimeWatch::TimeWatch(Logger& log, std::function<Reading()> read)
    : log_(log), read_(std::move(read)), last_(read_()) {}

void TimeWatch::Look() {
  const sync::MutexLock lock(mutex_);
  const Reading now = read_();
  const sync::TimeNs passed = now.running - last_.running;
  const sync::TimeNs step = now.wall - last_.wall - passed;
  last_ = now;
  if (passed - kTurn >= kPause) {
    pauses_ = {pauses_.count + 1, now.running, passed - kTurn};
    log_.Warn("the daemon did not run",
              {{"seconds", absl::StrFormat("%.1f", Seconds(pauses_.length))},
               {"hint",
                "it was stopped, its machine was, or it had no time for it; devices with a "
                "watchdog may have gone dark"}});
  }
  if (step >= kStep || step <= -kStep) {
    steps_ = {steps_.count + 1, now.running, step};
    log_.Warn("the wall clock stepped",
              {{"seconds", absl::StrFormat("%+.1f", Seconds(step))},
               {"hint", "lines of the log before and after are not in the order of their times"}});
  }
}

void TimeWatch::AddTo(ProcessFigures& figures) const {
  const sync::MutexLock lock(mutex_);
  figures.pauses = pauses_.count;
  figures.clock_steps = steps_.count;
  const sync::TimeNs now = read_().running;
  if (pauses_.count > 0 && now - pauses_.at < kTold) {
    figures.time_trouble =
        absl::StrCat(absl::StrFormat("the daemon did not run for %.1f s", Seconds(pauses_.length)),
                     " until ", Ago(now - pauses_.at, pauses_.count));
  }
  if (steps_.count > 0 && now - steps_.at < kTold) {
    absl::StrAppend(&figures.time_trouble, figures.time_trouble.empty() ? "" : "; ",
                    absl::StrFormat("the wall clock stepped by %+.1f s", Seconds(steps_.length)),
                    " ", Ago(now - steps_.at, steps_.count));
  }
}

}  // namespace voxeld::daemon
