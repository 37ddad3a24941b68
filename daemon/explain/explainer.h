// A thread for explanations, one after another: they take long, and may wait.
#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <functional>
#include <thread>

#include "display/sync/mutex.h"

namespace voxeld::daemon {

// Thread-safe. Its destructor drops what has not begun, and waits for what has.
class ExplainerThread {
 public:
  // `stopping` says that it should end early.
  using Work = std::function<void(const std::atomic<bool>& stopping)>;

  explicit ExplainerThread(size_t most_waiting) : most_waiting_(most_waiting) {}
  ~ExplainerThread();
  ExplainerThread(const ExplainerThread&) = delete;
  ExplainerThread& operator=(const ExplainerThread&) = delete;

  // False if as many are waiting already. The first starts the thread.
  bool Post(Work work);

 private:
  void Run();

  const size_t most_waiting_;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  std::deque<Work> waiting_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_ VOXELD_GUARDED_BY(mutex_);
  std::atomic<bool> stopping_ = false;
};

}  // namespace voxeld::daemon
