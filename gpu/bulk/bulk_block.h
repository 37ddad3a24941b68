// Immutable pieces of bulk memory, shared by all who hold them.
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

// A segment of a pool, as other processes come to know it. Thread-safe.
class BulkSegment {
 public:
  explicit BulkSegment(std::shared_ptr<Segment> memory);
  ~BulkSegment();
  BulkSegment(const BulkSegment&) = delete;
  BulkSegment& operator=(const BulkSegment&) = delete;

  uint64_t id() const { return id_; }  // no other of this process ever has the same
  const std::shared_ptr<Segment>& memory() const { return memory_; }

  // Has `gone` called once, on any thread, when no block is left and the pool keeps it no longer;
  // not if `alive` is gone by then, and it is held meanwhile. It must only post.
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

// A handle: copies are of the same piece, which goes back to its pool with the last. Nobody writes
// to it any more.
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
  // Whoever holds it holds the block.
  std::shared_ptr<const void> owner() const { return extent_; }

 private:
  std::shared_ptr<const Extent> extent_;
};

// Where a piece of bulk memory lies, as deltas and other processes are told.
struct BulkRef {
  uint64_t segment = 0;
  uint64_t offset = 0;
  uint64_t size = 0;
  uint64_t reserved = 0;
};

inline BulkRef RefOf(const BulkBlock& block) {
  return {.segment = block.segment()->id(), .offset = block.offset(), .size = block.size()};
}

// A piece that was found, and what keeps it: as long as `owner` is held, the bytes stay as they are.
struct BulkView {
  std::span<const std::byte> bytes;
  std::shared_ptr<const void> owner;
};

// Finds what a delta refers to.
class BulkSource {
 public:
  virtual ~BulkSource() = default;
  // InvalidArgument if there is no such piece: an unknown segment, or a range beyond its end.
  virtual absl::StatusOr<BulkView> Find(const BulkRef& ref) = 0;
};

// Finds blocks among those that came along with a delta.
class BlockSource final : public BulkSource {
 public:
  // `blocks` outlive it. The cost is that of looking for the block after the one found last.
  explicit BlockSource(std::span<const BulkBlock> blocks) : blocks_(blocks) {}
  absl::StatusOr<BulkView> Find(const BulkRef& ref) override;

 private:
  std::span<const BulkBlock> blocks_;
  size_t next_ = 0;
};

}  // namespace voxeld::gpu
