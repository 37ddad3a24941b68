// Segments of an engine's owner: given out, used again, named to the worker.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "display/sync/mutex.h"
#include "gpu/bulk/segment.h"

namespace voxeld::gpu {

// Thread-safe. What it hands out may outlive it.
class SegmentPool {
 public:
  struct Item {
    uint32_t id = 0;
    std::shared_ptr<Segment> segment;
    uint64_t holds = 0;  // of a frame's segment: the frame that it holds whole
  };
  using Lease = std::shared_ptr<Item>;  // the item goes back with its last owner

  // Told of a segment before it is first given out, and when it is kept no longer; any thread.
  using Told = std::function<void(const Item&)>;

  // Pools with the same worker share their numbers.
  using Ids = std::shared_ptr<std::atomic<uint32_t>>;

  SegmentPool(uint64_t limit_bytes, Ids ids, Told added, Told dropped);

  // At least `size` bytes. ResourceExhausted past the limit, which counts what is given out.
  absl::StatusOr<Lease> Acquire(size_t size);

 private:
  struct Shelf {
    sync::Mutex mutex;
    std::vector<std::unique_ptr<Item>> free VOXELD_GUARDED_BY(mutex);
    uint64_t out_bytes VOXELD_GUARDED_BY(mutex) = 0, kept_bytes VOXELD_GUARDED_BY(mutex) = 0;
    Told dropped;
  };
  static void GiveBack(Shelf& shelf, Item* item);

  const uint64_t limit_bytes_;
  const Ids ids_;
  const Told added_;
  const std::shared_ptr<Shelf> shelf_ = std::make_shared<Shelf>();
};

}  // namespace voxeld::gpu
