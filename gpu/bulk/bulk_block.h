// Immutable pieces of bulk memory, shared by everyone who holds them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "display/sync/mutex.h"
#include "gpu/bulk/segment.h"

namespace voxeld::gpu {

// A segment of a pool, as other processes know it. Thread-safe.
class BulkSegment {
 public:
  explicit BulkSegment(std::shared_ptr<Segment> memory);
  ~BulkSegment();
  BulkSegment(const BulkSegment&) = delete;
  BulkSegment& operator=(const BulkSegment&) = delete;

  uint64_t id() const { return id_; }  // never used by another segment of this process
  const std::shared_ptr<Segment>& memory() const { return memory_; }

  // Calls `gone` once, on any thread, when no block is left and the pool no longer keeps the
  // segment. Does not call it if `alive` has expired by then; holds `alive` during the call. `gone`
  // must only post.
  void WhenGone(std::weak_ptr<void> alive, std::function<void()> gone);

 private:
  struct Watcher {
    std::weak_ptr<void> alive;
    std::function<void()> gone;
  };

  const uint64_t id_;
  const std::shared_ptr<Segment> memory_;
  sync::Mutex mutex_;
  std::vector<Watcher> watchers_ VOXELD_GUARDED_BY(mutex_);
};

// A handle: copies refer to the same piece, which returns to its pool when the last copy is
// destroyed. The piece is not written again.
class BulkBlock {
 public:
  struct Extent {
    std::shared_ptr<BulkSegment> segment;
    size_t offset = 0, size = 0;
  };

  BulkBlock() = default;
  explicit BulkBlock(std::shared_ptr<const Extent> extent) : extent_(std::move(extent)) {}

  explicit operator bool() const { return extent_ != nullptr; }
  const std::shared_ptr<BulkSegment>& segment() const { return extent_->segment; }
  size_t offset() const { return extent_->offset; }
  size_t size() const { return extent_->size; }
  std::span<const std::byte> bytes() const {
    return extent_->segment->memory()->bytes().subspan(extent_->offset, extent_->size);
  }
  // Holding the returned pointer keeps the block alive.
  std::shared_ptr<const void> owner() const { return extent_; }

 private:
  std::shared_ptr<const Extent> extent_;
};

// The location of a piece of bulk memory, in the form that deltas and other processes use.
struct BulkRef {
  uint64_t segment = 0;
  uint64_t offset = 0;
  uint64_t size = 0;
  uint64_t reserved = 0;
};

inline BulkRef RefOf(const BulkBlock& block) {
  return {.segment = block.segment()->id(), .offset = block.offset(), .size = block.size()};
}

// A piece that was found, and its owner: while `owner` is held, the bytes do not change.
struct BulkView {
  std::span<const std::byte> bytes;
  std::shared_ptr<const void> owner;
};

// Finds the pieces that a delta refers to.
class BulkSource {
 public:
  virtual ~BulkSource() = default;
  // Errors: InvalidArgument if the piece does not exist: an unknown segment, or a range beyond the
  // segment's size.
  virtual absl::StatusOr<BulkView> Find(const BulkRef& ref) = 0;
};

// Finds blocks among those that came with a delta.
class BlockSource final : public BulkSource {
 public:
  // Requires: `blocks` outlives this object. Searches from the block after the last one found.
  explicit BlockSource(std::span<const BulkBlock> blocks) : blocks_(blocks) {}
  absl::StatusOr<BulkView> Find(const BulkRef& ref) override;

 private:
  std::span<const BulkBlock> blocks_;
  size_t next_ = 0;
};

}  // namespace voxeld::gpu
