// Bulk memory: what a daemon decodes into, and what engines read, in this process or another,
// without a copy between. Segments are cut into blocks; a block is written once by who asked for it,
// and from then on shared and immutable.
//
//   auto pool = BulkPool::Create({.limit_bytes = 1 << 30});
//   BulkPool::Fresh fresh = *pool->Allocate(size);
//   … write fresh.bytes …
//   BulkBlock block = std::move(fresh.block);  // hand it on; nobody writes any more
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
  size_t segment_bytes = size_t{32} << 20;   // a block that is greater has a segment to itself
  // Of segments in which nothing is used: kept for the next block until GiveBackUnused.
  uint64_t keep_bytes = uint64_t{64} << 20;
  // Can be handed to another process, which then cannot write to it.
  bool shared = true;
};

// Thread-safe. Blocks may outlive it.
class BulkPool {
 public:
  static constexpr size_t kAlign = 64;

  struct Fresh {
    BulkBlock block;
    std::span<std::byte> bytes;  // of the block, what is in them undefined
  };

  static std::shared_ptr<BulkPool> Create(const BulkPoolOptions& options = {});
  ~BulkPool();

  // `size` bytes (at least 1), 64-byte aligned. ResourceExhausted past the limit or if the system
  // has none left, with the figures. The smallest free place that is large enough is taken.
  absl::StatusOr<Fresh> Allocate(size_t size);

  // Returns all segments in which nothing is used to the system. For when clients have left.
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
