#include "gpu/bulk/bulk_pool.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"

namespace voxeld::gpu {
namespace {

using Released = std::vector<std::shared_ptr<BulkSegment>>;  // released outside the lock

}  // namespace

struct BulkPool::State : std::enable_shared_from_this<State> {
  explicit State(const BulkPoolOptions& wanted) : options(wanted) {}

  struct Room {
    std::shared_ptr<BulkSegment> segment;
    std::map<size_t, size_t> free;  // offset → size; neighbours are joined
    size_t size() const { return segment->memory()->bytes().size(); }
    bool unused() const { return free.size() == 1 && free.begin()->second == size(); }
  };
  using Place = std::tuple<size_t, uint64_t, size_t>;  // size, segment, offset

  // Returns null if no free place is large enough.
  std::shared_ptr<PooledExtent> Take(size_t size) VOXELD_REQUIRES(mutex);
  absl::Status AddRoom(size_t size, Released* released) VOXELD_REQUIRES(mutex);
  void GiveBack(const BulkBlock::Extent& extent);
  // Releases segments without used blocks until at most `most` bytes of such segments are left.
  void Trim(uint64_t most, Released* released) VOXELD_REQUIRES(mutex);
  // Returns the number of bytes that further segments may have.
  uint64_t Left() const VOXELD_REQUIRES(mutex) {
    return options.limit_bytes - std::min(held, options.limit_bytes);
  }
  void AddFree(Room& room, size_t offset, size_t size) VOXELD_REQUIRES(mutex);
  void EraseFree(Room& room, std::map<size_t, size_t>::iterator at) VOXELD_REQUIRES(mutex);

  const BulkPoolOptions options;
  mutable sync::Mutex mutex;
  std::map<uint64_t, Room> rooms VOXELD_GUARDED_BY(mutex);
  std::set<Place> places VOXELD_GUARDED_BY(mutex);  // all free places
  uint64_t held VOXELD_GUARDED_BY(mutex) = 0, used VOXELD_GUARDED_BY(mutex) = 0,
                unused VOXELD_GUARDED_BY(mutex) = 0;  // bytes of segments that are wholly free
};

struct BulkPool::PooledExtent final : BulkBlock::Extent {
  ~PooledExtent() { state->GiveBack(*this); }
  std::shared_ptr<State> state;
};

void BulkPool::State::AddFree(Room& room, size_t offset, size_t size) {
  room.free[offset] = size;
  places.emplace(size, room.segment->id(), offset);
}

void BulkPool::State::EraseFree(Room& room, std::map<size_t, size_t>::iterator at) {
  places.erase({at->second, room.segment->id(), at->first});
  room.free.erase(at);
}

std::shared_ptr<BulkPool::PooledExtent> BulkPool::State::Take(size_t size) {
  const auto place = places.lower_bound({size, 0, 0});
  if (place == places.end()) return nullptr;
  const auto [has, id, offset] = *place;
  Room& room = rooms.find(id)->second;
  auto extent = std::make_shared<PooledExtent>();
  extent->state = shared_from_this();
  extent->segment = room.segment;
  extent->offset = offset;
  extent->size = size;
  if (room.unused()) unused -= room.size();
  EraseFree(room, room.free.find(offset));
  if (has > size) AddFree(room, offset + size, has - size);
  used += size;
  return extent;
}

void BulkPool::State::Trim(uint64_t most, Released* released) {
  for (auto it = rooms.begin(); it != rooms.end() && unused > most;) {
    if (!it->second.unused()) {
      ++it;
      continue;
    }
    unused -= it->second.size();
    held -= it->second.size();
    EraseFree(it->second, it->second.free.begin());
    released->push_back(std::move(it->second.segment));
    it = rooms.erase(it);
  }
}

absl::Status BulkPool::State::AddRoom(size_t size, Released* released) {
  if (Left() < std::max<uint64_t>(size, options.segment_bytes)) Trim(0, released);
  if (Left() < size) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "bulk memory: ", size, " bytes asked for, ", used, " used, ", held,
        " held in segments, limit ", options.limit_bytes, "; send less or raise the limit"));
  }
  const uint64_t most = Left() / kAlign * kAlign;
  const size_t make = std::max<size_t>(size, std::min<uint64_t>(options.segment_bytes, most));
  absl::StatusOr<std::shared_ptr<Segment>> memory =
      options.shared ? Segment::CreateReadOnlyForOthers(make) : Segment::CreatePrivate(make);
  if (!memory.ok()) return memory.status();
  auto segment = std::make_shared<BulkSegment>(*std::move(memory));
  Room& room = rooms[segment->id()];
  room.segment = std::move(segment);
  AddFree(room, 0, make);
  held += make;
  unused += make;
  return absl::OkStatus();
}

void BulkPool::State::GiveBack(const BulkBlock::Extent& extent) {
  Released released;
  sync::MutexLock lock(mutex);
  Room& room = rooms.find(extent.segment->id())->second;
  size_t begin = extent.offset, end = extent.offset + extent.size;
  auto after = room.free.lower_bound(begin);
  if (after != room.free.begin()) {
    const auto before = std::prev(after);
    if (before->first + before->second == begin) {
      begin = before->first;
      EraseFree(room, before);
    }
  }
  if (after != room.free.end() && after->first == end) {
    end += after->second;
    EraseFree(room, after);
  }
  AddFree(room, begin, end - begin);
  used -= extent.size;
  if (!room.unused()) return;
  unused += room.size();
  Trim(options.keep_bytes, &released);
}

BulkPool::BulkPool(std::shared_ptr<State> state) : state_(std::move(state)) {}

BulkPool::~BulkPool() = default;

std::shared_ptr<BulkPool> BulkPool::Create(const BulkPoolOptions& options) {
  return std::shared_ptr<BulkPool>(new BulkPool(std::make_shared<State>(options)));
}

absl::StatusOr<BulkPool::Fresh> BulkPool::Allocate(size_t size) {
  if (size > SIZE_MAX - kAlign) return absl::ResourceExhaustedError("bulk memory: absurd size");
  const size_t rounded = std::max(kAlign, (size + kAlign - 1) / kAlign * kAlign);
  Released released;
  std::shared_ptr<PooledExtent> extent;
  {
    sync::MutexLock lock(state_->mutex);
    extent = state_->Take(rounded);
    if (extent == nullptr) {
      if (absl::Status status = state_->AddRoom(rounded, &released); !status.ok()) return status;
      extent = state_->Take(rounded);
    }
  }
  const std::span<std::byte> bytes =
      extent->segment->memory()->bytes().subspan(extent->offset, size);
  return Fresh{BulkBlock(std::move(extent)), bytes};
}

void BulkPool::GiveBackUnused() {
  Released released;
  sync::MutexLock lock(state_->mutex);
  state_->Trim(0, &released);
}

uint64_t BulkPool::limit_bytes() const { return state_->options.limit_bytes; }

uint64_t BulkPool::used_bytes() const {
  sync::MutexLock lock(state_->mutex);
  return state_->used;
}

uint64_t BulkPool::held_bytes() const {
  sync::MutexLock lock(state_->mutex);
  return state_->held;
}

}  // namespace voxeld::gpu
