// Items of one kind by the regions that they touch: a few batches, each for one layer.
//
// A change adds a batch; batches of similar size are merged, and removed items are dropped in the
// process, so an index of n items costs O(log n) per item.
//
// Lists have a budget. A batch whose lists do not fit, or would leave too little memory for making
// others, is deferred: only the items, and which regions they touch, are kept. Before a deferred
// batch is drawn, it is sorted for the blocks of regions that are drawn then; or it is drawn
// without lists, by threads that test all of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/line_types.h"
#include "gpu/cuda/list_budget.h"

namespace voxeld::gpu::cuda {

// Drawables of one layer that are added to an index together.
struct Arrivals {
  uint32_t layer = 0;  // the slot of the layer
  bool drawn = true;
  bool mixed = false;         // some item may have several colours
  uint32_t regions_each = 0;  // that an item touches at most, for kinds that use it
  ItemList list;              // on the device
  std::span<const uint32_t> slots;
  std::span<const uint64_t> first;  // as in the list
  // The entries of all these drawables, if the table does not have them yet; or null.
  const FewEntries* entries = nullptr;
};

// The bookkeeping, for any kind of items. Thread-bound. Calls queue work in the device's stream.
class RegionIndex {
 public:
  virtual ~RegionIndex() = default;
  RegionIndex(const RegionIndex&) = delete;
  RegionIndex& operator=(const RegionIndex&) = delete;

  // Clears the index, for a volume of that grid, in which the tiles of `owned` (a TileOwner each)
  // are drawn: of items elsewhere only the items themselves are stored.
  void Reset(const TileGrid& grid, std::span<const uint8_t> owned);
  // Returns the slots of layers that have items here; at most kMaxRegionLayers may have any.
  absl::flat_hash_set<uint32_t> Layers() const;
  // Returns the bytes in the host's memory.
  uint64_t host_bytes() const;
  uint64_t live() const;  // items
  // Returns the limit of items in one Add.
  uint64_t most_items() const { return most_items_; }
  // Returns whether that many more items leave at most as many batches, once merged, as can be
  // drawn: of two batches of a layer that stay separate, one has more than half of the items that a
  // batch may have, and half of these may be dead.
  bool MayHave(uint64_t items) const {
    return live() + items <= (kMaxRegionBatches - kMaxRegionLayers) / 4 * most_items_;
  }

  // Adds drawables; marks their regions if they are visible. Errors: ResourceExhausted, with
  // nothing added, if there is too little memory.
  absl::Status Add(TableEntry* table, const Arrivals& arrivals, uint8_t* region_dirty);

  // Marks the regions of drawables.
  absl::Status Mark(std::span<const uint32_t> slots, uint8_t* region_dirty);
  // Drops drawables. An error leaves them listed, some of them dark: call it again.
  absl::Status Drop(std::span<const uint32_t> slots);

  // Merges batches of similar size. Running out of memory is not an error, unless there are more
  // than kMaxRegionBatches.
  absl::Status Merge();

  // Sorts deferred batches that fit now that other lists have been released.
  absl::Status SortDeferred();
  // Handles the items of deferred batches, of layers for which seen(slot) is true.
  using Seen = std::function<bool(uint32_t)>;
  uint64_t CountDeferred(const Seen& seen) const;
  // Gives such batches lists, until EndPass, of their items in the blocks that `within` draws.
  // Returns false if they do not all fit: then none may have lists, but with `some`, those that fit
  // have them.
  absl::StatusOr<bool> SortWithin(const RegionGrid& within, const Seen& seen, bool some);
  void EndPass();

 protected:
  struct Member {
    uint32_t slot, first, count;  // items, at least one
    bool live;
  };
  struct Batch {
    uint32_t layer = 0;
    uint32_t count = 0, live = 0;  // items
    uint32_t regions_each = 0;
    bool mixed = false;
    Block items, colors;  // `colors` only if mixed
    // Lists by region, as the kind defines them.
    Block begin, base, offsets, regions, spans;
    RegionGrid within;  // the regions that the lists cover, if the kind uses it
    // The lists did not fit: at most `regions` exists.
    bool deferred = false;
    // Bytes that the lists took, or would have taken at least; and including the memory needed to
    // make them.
    uint64_t list_bytes = 0, sort_bytes = 0;
    std::vector<Member> members;
  };

  // `lists` must outlive the index. what: the items' name in error messages. Sizes are in bytes, of
  // an item and of its further colours.
  RegionIndex(Device& device, ListBudget& lists, const char* what, size_t item_size,
              size_t color_size)
      : device_(device),
        lists_(lists),
        what_(what),
        item_size_(item_size),
        color_size_(color_size) {}

  const absl::flat_hash_map<uint64_t, Batch>& batches() const { return batches_; }
  Device& device() const { return device_; }
  Pool& lists() const { return lists_.pool; }
  const RegionGrid& grid() const { return grid_; }

 private:
  // ---- implemented by each kind. Each queues its kernels.
  // Returns the greatest number of regions that an item touches.
  virtual uint64_t MostRegions() const = 0;
  // Makes batch.items and colors from the list.
  virtual absl::Status Make(const TableEntry* table, const ItemList& list, const Batch& batch) = 0;
  // Puts the entries into the table, and makes and sorts the items, all at once. Returns false,
  // with nothing done, if there are too many or too little memory.
  virtual absl::StatusOr<bool> MakeFew(TableEntry*, const Arrivals&, Batch&, uint8_t*) {
    return false;
  }
  // Copies `count` items at `first` of the list, in which rows are those of `from`, to `to`.
  virtual absl::Status Copy(const ItemList& list, uint64_t first, uint32_t count, const Batch& from,
                            const Batch& to) = 0;
  // Sorts the items by region, as fast as possible, with as much memory as that takes; with
  // `region_dirty` marks the regions that have any.
  virtual absl::Status SortAll(Batch& batch, uint8_t* region_dirty) = 0;
  // Sorts those in the blocks that `within` draws, with as little memory as possible. `regions` is
  // used in place of the batch's own.
  virtual absl::Status SortExactly(Batch& batch, Block& regions, const RegionGrid& within,
                                   uint8_t* region_dirty) = 0;
  // Adds to `regions`, by block, a bit for each region that has any.
  virtual absl::Status FindRegions(const Batch& batch, uint64_t* regions) = 0;
  // Marks the regions that have any; for a deferred batch, by its `regions`.
  virtual absl::Status MarkAll(const Batch& batch, uint8_t* region_dirty) = 0;
  // For items in rows, `count` in all, whose first is slot(d): marks the regions that they touch,
  // or, without `region_dirty`, makes them draw nothing from now on.
  virtual absl::Status Touch(const ItemList& list, uint32_t count, const Batch& batch,
                             uint8_t* region_dirty) = 0;

  struct Place {
    uint64_t batch;  // its number
    size_t member;
  };
  // Some items of a batch.
  struct Found {
    uint64_t count = 0;
    std::vector<Member> members;
  };

  absl::flat_hash_map<uint64_t, Found> Find(std::span<const uint32_t> slots) const;
  absl::Status TouchFound(const Batch& batch, Found& found, uint8_t* region_dirty);
  absl::Status TakeItems(Batch& batch);
  absl::Status MergeFrom(const std::vector<uint64_t>& numbers);
  static void DropLists(Batch& batch);  // except `regions`
  // Returns whether an attempt to make lists, which ended with `status`, took more than the budget.
  bool WentOver(const absl::Status& status) const {
    return absl::IsResourceExhausted(status) || (status.ok() && lists_.KeepsTooMuch());
  }
  // Makes the items of a new batch, and sorts it.
  absl::Status MakeAndSort(TableEntry* table, const Arrivals& arrivals, Batch& batch,
                           uint8_t* region_dirty);
  // Sorts the batch, or defers it.
  absl::Status Sort(Batch& batch, uint8_t* region_dirty);
  absl::Status Defer(Batch& batch, uint8_t* region_dirty);

  Device& device_;
  ListBudget& lists_;
  const char* const what_;
  const size_t item_size_, color_size_;
  RegionGrid grid_;
  uint64_t next_number_ = 1, most_items_ = 0;
  uint64_t used_ = 0;   // of the lists' pool, when SortDeferred last tried
  bool merge_ = false;  // something has changed since merging was last done or abandoned
  absl::flat_hash_map<uint64_t, Batch> batches_;  // by number
  absl::flat_hash_map<uint32_t, Place> places_;   // by slot of the table
};

}  // namespace voxeld::gpu::cuda
