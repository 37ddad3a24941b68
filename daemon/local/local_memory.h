// The memory that the client of one session has handed over: sealed memfds, mapped for reading.
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
  // Per session, held at the same time.
  uint32_t max_memories = 256;
  uint64_t max_bytes = uint64_t{1} << 30;
  // For all sessions together: the kernel gives a process 65,530 mappings, most of which are needed
  // for other purposes.
  uint32_t max_memories_total = 16'384;
};

// Thread-safe. The result of Find stays mapped while it is used, even if it is released meanwhile.
// Only held memory counts against the session's limits, but all mapped memory is charged to the
// budget.
class LocalMemory final : public wire::MemorySource {
 public:
  // `mapped` counts the mappings of all sessions. `budget` may be null.
  LocalMemory(const LocalLimits& limits, std::shared_ptr<std::atomic<uint32_t>> mapped,
              std::shared_ptr<Budget> budget)
      : limits_(limits), mapped_(std::move(mapped)), budget_(std::move(budget)) {}

  // Maps `fd`, which the caller keeps. Requires: it has `size` bytes and is sealed against
  // shrinking, growing and writing; otherwise the error is InvalidArgument. Other errors:
  // AlreadyExists if `id` is in use; ResourceExhausted beyond a limit or the budget, or if mapping
  // fails; FailedPrecondition after End.
  absl::Status Hold(uint64_t id, uint64_t size, int fd);

  absl::Status Release(uint64_t id);  // error: NotFound
  void ReleaseAll();                  // for the end of the connection that handed it over

  void End();  // ends the session: releases everything and accepts nothing more
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
