// A thread for explanations, one after another: they take long, and may wait.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

#include "gpu/call_queue.h"

namespace voxeld::daemon {

// Thread-safe. Its destructor drops what has not begun, and waits for what has.
class ExplainerThread {
 public:
  // `stopping` says that it should end early.
  using Work = std::function<void(const std::atomic<bool>& stopping)>;

  explicit ExplainerThread(size_t most_waiting) : most_waiting_(most_waiting) {}
  ~ExplainerThread() { stopping_ = true; }
  ExplainerThread(const ExplainerThread&) = delete;
  ExplainerThread& operator=(const ExplainerThread&) = delete;

  // False if as many are waiting already.
  bool Post(Work work);

 private:
  const size_t most_waiting_;
  std::atomic<size_t> waiting_ = 0;
  std::atomic<bool> stopping_ = false;
  gpu::CallQueue queue_{/*run_inline=*/false};  // the first to end
};

}  // namespace voxeld::daemon
