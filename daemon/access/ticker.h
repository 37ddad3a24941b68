// Runs a function at a fixed interval on its own thread, timed by an injected clock.
#pragma once

#include <functional>
#include <thread>
#include <utility>

#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::access {

// Thread-safe.
class Ticker {
 public:
  // Calls `work` on the ticker's thread, for the first time after one interval. `clock` must
  // outlive this object.
  Ticker(sync::Clock& clock, sync::TimeNs interval, std::function<void()> work)
      : clock_(clock), interval_(interval), work_(std::move(work)), thread_([this] { Run(); }) {}
  ~Ticker() {
    {
      sync::MutexLock lock(mutex_);
      stop_ = true;
      changed_.NotifyAll();
    }
    thread_.join();
  }
  Ticker(const Ticker&) = delete;
  Ticker& operator=(const Ticker&) = delete;

 private:
  void Run() {
    for (;;) {
      {
        sync::MutexLock lock(mutex_);
        const sync::TimeNs due = clock_.Now() + interval_;
        while (!stop_ && clock_.Now() < due) clock_.WaitUntil(mutex_, changed_, due);
        if (stop_) return;
      }
      work_();
    }
  }

  sync::Clock& clock_;
  const sync::TimeNs interval_;
  const std::function<void()> work_;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace voxeld::daemon::access
