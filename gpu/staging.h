// Staging memory in ordinary memory, within a limit that counts every block that anyone still
// holds.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

// Thread-safe. Blocks may outlive the pool.
class StagingPool {
 public:
  explicit StagingPool(uint64_t limit_bytes);
  // Returns a 16-byte aligned block. Errors: ResourceExhausted past the limit, or if the system is
  // out of memory.
  absl::StatusOr<StagingBlock> Acquire(size_t size);

 private:
  uint64_t limit_bytes_;
  std::shared_ptr<std::atomic<uint64_t>> held_;
};

}  // namespace voxeld::gpu
