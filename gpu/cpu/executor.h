// Parallel loops over independent work, the only way in which the engine uses several cores.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace voxeld::gpu {

// Used by one thread at a time.
class Executor {
 public:
  // One index of a loop; `worker`, 0 to concurrency() − 1, names who runs it: no two run under the
  // same number at once. What it throws ends the loop.
  using Body = std::function<void(size_t index, int worker)>;

  virtual ~Executor() = default;
  virtual int concurrency() const = 0;
  // Calls `body` once for each index in [0, count), in any order; returns when all are done.
  // Indices are handed out in runs of `grain` (at least 1). What a body throws first is thrown once none runs
  // any more; some indices are then left out.
  virtual void For(size_t count, size_t grain, const Body& body) = 0;
  // Throws if For would (MakeAbandonableExecutor). Long work outside loops calls it now and then.
  virtual void ThrowIfAbandoned() const {}
};

// In the caller's thread.
std::unique_ptr<Executor> MakeSerialExecutor();
// `threads` ≥ 1 in all, the caller's among them.
std::unique_ptr<Executor> MakeThreadExecutor(int threads);
// The one to use: oneTBB's scheduler, or threads of our own in builds for ThreadSanitizer, which
// cannot see into a prebuilt scheduler.
std::unique_ptr<Executor> MakeExecutor(int threads);

}  // namespace voxeld::gpu
