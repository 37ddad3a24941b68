// A thread for what may block, in the order in which it was asked for.
#pragma once

#include <deque>
#include <functional>
#include <thread>
#include <utility>

#include "display/sync/mutex.h"

namespace voxeld::daemon::play {

// Thread-safe. The destructor has all that was asked for done.
class Worker {
 public:
  Worker() : thread_([this] { Run(); }) {}
  ~Worker() {
    Post(nullptr);
    thread_.join();
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void Post(std::function<void()> work) {
    const sync::MutexLock lock(mutex_);
    waiting_.push_back(std::move(work));
    changed_.NotifyAll();
  }

 private:
  void Run() {
    for (;;) {
      std::function<void()> work;
      {
        const sync::MutexLock lock(mutex_);
        while (waiting_.empty()) changed_.Wait(mutex_);
        work = std::move(waiting_.front());
        waiting_.pop_front();
      }
      if (!work) return;
      work();
    }
  }

  sync::Mutex mutex_;
  sync::CondVar changed_;
  std::deque<std::function<void()>> waiting_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace voxeld::daemon::play
