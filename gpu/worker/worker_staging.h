// Staging memory of an engine in another process, or of several that are sent the same: a block is
// one segment, which each of them maps.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "display/sync/mutex.h"
#include "gpu/engine.h"
#include "gpu/worker/call_channel.h"
#include "gpu/worker/segment_pool.h"

namespace voxeld::gpu {

// Announces a pool's segments to the workers at the other ends of some channels. Thread-safe.
class SegmentNews {
 public:
  // Must be called before the first segment. Listeners that have expired are skipped.
  void AddListener(std::weak_ptr<CallChannel> channel);

  // Returns a callback for the pool. `staging`: the segments are for data to the worker, not for
  // results.
  static SegmentPool::Told Added(std::shared_ptr<SegmentNews> news, bool staging);
  static SegmentPool::Told Dropped(std::shared_ptr<SegmentNews> news);

 private:
  void Tell(const SegmentPool::Item& item, bool added, bool staging);

  sync::Mutex mutex_;
  std::vector<std::weak_ptr<CallChannel>> channels_ VOXELD_GUARDED_BY(mutex_);
};

// A block of staging memory in a segment.
class LeasedMemory final : public StagingBlock::Memory {
 public:
  LeasedMemory(SegmentPool::Lease lease, size_t size) : lease_(std::move(lease)), size_(size) {}
  std::span<std::byte> bytes() override { return lease_->segment->bytes().first(size_); }
  const SegmentPool::Lease& lease() const { return lease_; }

 private:
  const SegmentPool::Lease lease_;
  const size_t size_;
};

// Thread-safe.
class WorkerStaging {
 public:
  explicit WorkerStaging(uint64_t limit_bytes);

  void AddListener(std::weak_ptr<CallChannel> channel) { news_->AddListener(std::move(channel)); }
  // The same as Engine::AcquireStaging; the memory is LeasedMemory.
  absl::StatusOr<StagingBlock> Acquire(size_t size);
  // Returns the numbers, for other pools of the same workers.
  const SegmentPool::Ids& ids() const { return ids_; }

 private:
  const SegmentPool::Ids ids_ = std::make_shared<std::atomic<uint32_t>>(1);
  const std::shared_ptr<SegmentNews> news_ = std::make_shared<SegmentNews>();
  SegmentPool pool_;
};

}  // namespace voxeld::gpu
