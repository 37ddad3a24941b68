// Memory that a request may name in place of payloads (voxeld.v1.MemoryRange). The decoder reads
// it through this; where it comes from (daemon/local) is not its business.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::daemon::wire {

// Bytes that stay there, and as they are, for as long as `mapping` lives.
struct MappedRange {
  std::string_view bytes;
  std::shared_ptr<const void> mapping;
};

class MemorySource {
 public:
  virtual ~MemorySource() = default;

  // `size` bytes from `offset` of the memory that the client calls `memory`. Thread-safe.
  //
  // NotFound: there is no such memory. OutOfRange: it ends before. Anything else: it cannot be read
  // now. Each message goes on from the name of the field at fault, as in "is 7; …": memory, size,
  // memory.
  virtual absl::StatusOr<MappedRange> Find(uint64_t memory, uint64_t offset,
                                           uint64_t size) const = 0;
};

}  // namespace voxeld::daemon::wire
