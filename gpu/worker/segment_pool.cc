#include "gpu/worker/segment_pool.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kLeast = 64 << 10;
constexpr uint64_t kMostKept = 512ull << 20;  // returned segments that are not released

// Rounds up to eighths of a power of two: all bytes of a segment are pinned, used or not.
size_t RoundUp(size_t size) {
  size = std::max(size, kLeast);
  const size_t step = std::bit_floor(size) / 8;
  return (size + step - 1) & ~(step - 1);
}

}  // namespace

SegmentPool::SegmentPool(uint64_t limit_bytes, Ids ids, Told added, Told dropped)
    : limit_bytes_(limit_bytes), ids_(std::move(ids)), added_(std::move(added)) {
  shelf_->dropped = std::move(dropped);
}

absl::StatusOr<SegmentPool::Lease> SegmentPool::Acquire(size_t size) {
  std::unique_ptr<Item> item;
  {
    sync::MutexLock lock(shelf_->mutex);
    if (size > limit_bytes_ || shelf_->out_bytes > limit_bytes_ - size) {
      return absl::ResourceExhaustedError(
          absl::StrCat("staging: ", size, " bytes asked for, ", shelf_->out_bytes, " held, limit ",
                       limit_bytes_, "; send less at once or raise the limit"));
    }
    const auto it =
        std::find_if(shelf_->free.rbegin(), shelf_->free.rend(), [&](const auto& candidate) {
          const size_t has = candidate->segment->bytes().size();
          return has >= size && has <= 2 * RoundUp(size);
        });
    if (it != shelf_->free.rend()) {
      item = std::move(*it);
      shelf_->free.erase(std::next(it).base());
      shelf_->kept_bytes -= item->segment->bytes().size();
    }
  }
  if (item == nullptr) {
    absl::StatusOr<std::shared_ptr<Segment>> segment = Segment::Create(RoundUp(size));
    if (!segment.ok()) return segment.status();
    item = std::make_unique<Item>();
    item->segment = *std::move(segment);
    item->id = (*ids_)++;
    added_(*item);
  }
  {
    sync::MutexLock lock(shelf_->mutex);
    shelf_->out_bytes += size;
  }
  return Lease(item.release(), [shelf = shelf_, size](Item* done) {
    {
      sync::MutexLock lock(shelf->mutex);
      shelf->out_bytes -= size;
    }
    GiveBack(*shelf, done);
  });
}

void SegmentPool::GiveBack(Shelf& shelf, Item* item) {
  std::vector<std::unique_ptr<Item>> dropped;
  {
    sync::MutexLock lock(shelf.mutex);
    shelf.kept_bytes += item->segment->bytes().size();
    shelf.free.emplace_back(item);
    while (shelf.kept_bytes > kMostKept && !shelf.free.empty()) {
      shelf.kept_bytes -= shelf.free.front()->segment->bytes().size();
      dropped.push_back(std::move(shelf.free.front()));
      shelf.free.erase(shelf.free.begin());
    }
  }
  for (const auto& gone : dropped) shelf.dropped(*gone);
}

}  // namespace voxeld::gpu
