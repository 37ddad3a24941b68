// Runs explanations one after another on a separate thread, because they take long.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

#include "gpu/call_queue.h"

namespace voxeld::daemon {

// Thread-safe. The destructor drops queued work and waits for running work.
class ExplainerThread {
 public:
  // `stopping` becomes true when the work should stop early.
  using Work = std::function<void(const std::atomic<bool>& stopping)>;

  explicit ExplainerThread(size_t most_waiting) : most_waiting_(most_waiting) {}
  ~ExplainerThread() { stopping_ = true; }
  ExplainerThread(const ExplainerThread&) = delete;
  ExplainerThread& operator=(const ExplainerThread&) = delete;

  // Returns: false if `most_waiting` explanations are already waiting.
  bool Post(Work work);

 private:
  const size_t most_waiting_;
  std::atomic<size_t> waiting_ = 0;
  std::atomic<bool> stopping_ = false;
  gpu::CallQueue queue_{/*run_inline=*/false};  // destroyed first
};

}  // namespace voxeld::daemon
