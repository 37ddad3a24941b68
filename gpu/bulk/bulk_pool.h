// Bulk memory: a daemon decodes into it, and engines read it, in this process or another, without
// copying. Segments are divided into blocks. A block is written once, by the caller that allocated
// it, and is shared and immutable from then on.
// and from then on shared and immutable.
//
//   auto pool = BulkPool::Create({.limit_bytes = 1 << 30});
//   BulkPool::Fresh fresh = *pool->Allocate(size);
//   … write fresh.bytes …
//   BulkBlock block = std::move(fresh.block);  // hand it on; from here on it must not be written
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "gpu/bulk/bulk_block.h"

namespace voxeld::gpu {

struct BulkPoolOptions {
  uint64_t limit_bytes = uint64_t{1} << 30;  // of all segments together, used or not
  size_t segment_bytes = size_t{32} << 20;   // a larger block has a segment to itself
  // Limit of segments without used blocks, which are kept for the next block until GiveBackUnused.
  uint64_t keep_bytes = uint64_t{64} << 20;
  // The memory can be passed to another process, which cannot write to it.
  bool shared = true;
};

// Thread-safe. Blocks may outlive it.
class BulkPool {
 public:
  static constexpr size_t kAlign = 64;

  struct Fresh {
    BulkBlock block;
    std::span<std::byte> bytes;  // of the block, with undefined contents
  };

  static std::shared_ptr<BulkPool> Create(const BulkPoolOptions& options = {});
  ~BulkPool();

  // Returns `size` bytes (at least 1), 64-byte aligned, in the smallest free place that is large
  // enough. Errors: ResourceExhausted past the limit or if the system is out of memory, with the
  // sizes.
  absl::StatusOr<Fresh> Allocate(size_t size);

  // Returns all segments without used blocks to the system. Called when clients have left.
  void GiveBackUnused();

  uint64_t limit_bytes() const;
  uint64_t used_bytes() const;  // of all blocks, each a multiple of 64
  uint64_t held_bytes() const;  // of all segments

 private:
  struct State;
  struct PooledExtent;
  explicit BulkPool(std::shared_ptr<State> state);

  const std::shared_ptr<State> state_;
};

}  // namespace voxeld::gpu
