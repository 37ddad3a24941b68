#include "gpu/bulk/bulk_block.h"

#include <atomic>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

// Pools may share a worker, which identifies segments by their numbers alone.
uint64_t NewId() {
  static std::atomic<uint64_t> next{1};
  return next++;
}

}  // namespace

BulkSegment::BulkSegment(std::shared_ptr<Segment> memory)
    : id_(NewId()), memory_(std::move(memory)) {}

BulkSegment::~BulkSegment() {
  std::vector<Watcher> watchers;
  {
    sync::MutexLock lock(mutex_);
    watchers.swap(watchers_);
  }
  for (const Watcher& watcher : watchers) {
    if (const std::shared_ptr<void> alive = watcher.alive.lock()) watcher.gone();
  }
}

void BulkSegment::WhenGone(std::weak_ptr<void> alive, std::function<void()> gone) {
  sync::MutexLock lock(mutex_);
  std::erase_if(watchers_, [](const Watcher& watcher) { return watcher.alive.expired(); });
  watchers_.push_back({std::move(alive), std::move(gone)});
}

absl::StatusOr<BulkView> BlockSource::Find(const BulkRef& ref) {
  // Blocks usually arrive in the order in which they are referred to.
  for (size_t tried = 0; tried < blocks_.size(); ++tried) {
    const BulkBlock& block = blocks_[next_];
    next_ = (next_ + 1) % blocks_.size();
    if (block.segment()->id() != ref.segment || block.offset() != ref.offset) continue;
    if (block.size() != ref.size) {
      return absl::InvalidArgumentError(absl::StrCat("bulk memory: the block at byte ", ref.offset,
                                                     " of segment ", ref.segment, " has ",
                                                     block.size(), " bytes, not ", ref.size));
    }
    return BulkView{block.bytes(), block.owner()};
  }
  return absl::InvalidArgumentError(absl::StrCat("bulk memory: no block at byte ", ref.offset,
                                                 " of segment ", ref.segment,
                                                 " came with the delta"));
}

}  // namespace voxeld::gpu
