// The segments of an engine's owner: handed out, reused, and named to the worker.
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

// Thread-safe. Leases may outlive the pool.
class SegmentPool {
 public:
  struct Item {
    uint32_t id = 0;
    std::shared_ptr<Segment> segment;
    uint64_t holds = 0;  // for a frame's segment: the frame that it holds completely
  };
  using Lease = std::shared_ptr<Item>;  // the item returns to the pool with its last owner

  // Called with a segment before it is first handed out, and when the pool no longer keeps it; on
  // any thread.
  using Told = std::function<void(const Item&)>;

  // Pools with the same worker share their numbers.
  using Ids = std::shared_ptr<std::atomic<uint32_t>>;

  SegmentPool(uint64_t limit_bytes, Ids ids, Told added, Told dropped);

  // Returns at least `size` bytes. Errors: ResourceExhausted past the limit, which counts what is
  // handed out.
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
