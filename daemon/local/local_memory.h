// The memory that one session's client has handed over: sealed memfds, mapped for reading.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/core/budget.h"
#include "daemon/wire/memory_source.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::local {

struct LocalLimits {
  // Of one session, held at once.
  uint32_t max_memories = 256;
  uint64_t max_bytes = uint64_t{1} << 30;
  // Of all sessions together: the kernel gives a process 65,530 mappings, and most of them are for
  // others.
  uint32_t max_memories_total = 16'384;
};

// Thread-safe. What Find gave stays mapped until it is let go, also when it is released meanwhile;
// only what is held counts against the session's limits, but all that is mapped is charged to the
// budget.
class LocalMemory final : public wire::MemorySource {
 public:
  // `mapped` counts the mappings of all sessions. `budget` may be none.
  LocalMemory(const LocalLimits& limits, std::shared_ptr<std::atomic<uint32_t>> mapped,
              std::shared_ptr<Budget> budget)
      : limits_(limits), mapped_(std::move(mapped)), budget_(std::move(budget)) {}

  // Maps `fd`, which stays the caller's: sealed against shrinking, growing and writing, of `size`
  // bytes. Else InvalidArgument; AlreadyExists if `id` is in use; ResourceExhausted beyond a limit
  // or the budget, or if it cannot be mapped; FailedPrecondition once the session has ended.
  absl::Status Hold(uint64_t id, uint64_t size, int fd);

  absl::Status Release(uint64_t id);  // NotFound
  void ReleaseAll();                  // the connection that brought it has ended

  void End();  // the session has: lets all go, and takes nothing more
  bool ended() const;

  absl::StatusOr<wire::MappedRange> Find(uint64_t memory, uint64_t offset,
                                         uint64_t size) const override;

  uint64_t bytes() const;     // held
  uint64_t memories() const;  // held
  const LocalLimits& limits() const { return limits_; }

 private:
  class Mapping;
  using Mappings = std::map<uint64_t, std::shared_ptr<const Mapping>>;

  const LocalLimits limits_;
  const std::shared_ptr<std::atomic<uint32_t>> mapped_;
  const std::shared_ptr<Budget> budget_;
  mutable sync::Mutex mutex_;
  Mappings held_ VOXELD_GUARDED_BY(mutex_);
  uint64_t bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool ended_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::daemon::local
