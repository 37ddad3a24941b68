// What one request reads from its session's local memory: found, checked, counted.
#pragma once

#include <cstdint>

#include "daemon/wire/check.h"
#include "daemon/wire/memory_source.h"

namespace voxeld::v1 {
class MemoryRange;
}

namespace voxeld::daemon::wire {

// A range costs its sender nothing, and what it names is copied: so there is a most that one
// request may name, whatever it names twice counted twice.
class LocalRanges {
 public:
  // `source` outlives it.
  LocalRanges(const MemorySource& source, const Limits& limits)
      : source_(source), limit_(limits.max_uncommitted_bytes) {}
  LocalRanges(const LocalRanges&) = delete;
  LocalRanges& operator=(const LocalRanges&) = delete;

  // `path` is that of the MemoryRange. Its size has been compared with what is wanted.
  MaybeFault Read(const FieldPath& path, const v1::MemoryRange& range, MappedRange* out);

  uint64_t bytes_read() const { return bytes_read_; }

 private:
  const MemorySource& source_;
  const uint64_t limit_;
  uint64_t bytes_read_ = 0;
};

// What is wrong with a range where there is no local memory.
Fault NoLocalMemory(const FieldPath& path, const v1::MemoryRange& range);

}  // namespace voxeld::daemon::wire
