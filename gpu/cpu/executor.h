// Parallel loops over independent work: the only way in which the engine uses several cores.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace voxeld::gpu {

// Used by one thread at a time.
class Executor {
 public:
  // Handles one index of a loop. `worker`, 0 to concurrency() − 1, is the number of the worker that
  // runs it; no two calls with the same number run at once. An exception ends the loop.
  using Body = std::function<void(size_t index, int worker)>;

  virtual ~Executor() = default;
  virtual int concurrency() const = 0;
  // Calls `body` once for each index in [0, count), in any order; returns when all are done.
  // Indices are handed out in runs of `grain` (at least 1). For rethrows the first exception of a
  // body after all bodies have returned; some indices are then left out.
  virtual void For(size_t count, size_t grain, const Body& body) = 0;
  // Throws if For would (MakeAbandonableExecutor). Call it now and then in long work outside loops.
  virtual void ThrowIfAbandoned() const {}
};

// Returns an executor that runs loops in the caller's thread.
std::unique_ptr<Executor> MakeSerialExecutor();
// Returns an executor of `threads` ≥ 1 threads in all, including the caller's.
std::unique_ptr<Executor> MakeThreadExecutor(int threads);
// Returns the executor to use: oneTBB's scheduler or, in builds for ThreadSanitizer, which cannot
// see into a prebuilt scheduler, our own threads.
std::unique_ptr<Executor> MakeExecutor(int threads);

}  // namespace voxeld::gpu
