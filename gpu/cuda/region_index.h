// Items of one kind by the regions that they touch: a few batches, each of one layer.
//
// A change adds a batch; batches of like size are merged, and items that have gone are dropped on the
// way: so an index of n items costs O(log n) an item.
//
// Lists have a budget. A batch for whose lists there is no room, or whose lists would leave too little
// for others' making, is deferred: of it are kept the items, and which regions they touch. Before it is
// drawn, it is sorted as far as some blocks of regions go that are drawn then; or it is drawn without
// lists, by threads that look through all of it.
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

// Drawables of one layer that come into an index together.
struct Arrivals {
  uint32_t layer = 0;  // its slot
  bool drawn = true;
  bool mixed = false;         // some item may have several colours
  uint32_t regions_each = 0;  // that an item touches at most, of kinds that want to know
  ItemList list;              // on the device
  std::span<const uint32_t> slots;
  std::span<const uint64_t> first;  // as in the list
  // Entries that the table does not have yet: then all of these drawables'; or null.
  const FewEntries* entries = nullptr;
};

// The bookkeeping, whatever the items are. Thread-bound; its calls queue work in the device's stream.
class RegionIndex {
 public:
  virtual ~RegionIndex() = default;
  RegionIndex(const RegionIndex&) = delete;
  RegionIndex& operator=(const RegionIndex&) = delete;

  // Forgets all, for a volume of that grid, of which the tiles are drawn that `owned` has (a TileOwner
  // each): of items elsewhere nothing is kept but themselves.
  void Reset(const TileGrid& grid, std::span<const uint8_t> owned);
  // The slots of layers that have items here; no more than kMaxRegionLayers may.
  absl::flat_hash_set<uint32_t> Layers() const;
  // In the host's memory.
  uint64_t host_bytes() const;
  uint64_t live() const;  // items
  // Items that may come in one Add.
  uint64_t most_items() const { return most_items_; }
  // Whether so many more leave no more batches, once merged, than can be drawn: of two of a layer that
  // stay apart, one has more than half of what one may have, and half of these may be dead.
  bool MayHave(uint64_t items) const {
    return live() + items <= (kMaxRegionBatches - kMaxRegionLayers) / 4 * most_items_;
  }

  // Adds them; marks regions if they are to be seen. ResourceExhausted, and nothing is added, if
  // memory does not suffice.
  absl::Status Add(TableEntry* table, const Arrivals& arrivals, uint8_t* region_dirty);

  // Marks the regions of drawables.
  absl::Status Mark(std::span<const uint32_t> slots, uint8_t* region_dirty);
  // Drops them. An error leaves them listed, some of them dark: to be called again.
  absl::Status Drop(std::span<const uint32_t> slots);

  // Merges batches of like size. Want of memory is no error, unless there are more than
  // kMaxRegionBatches.
  absl::Status Merge();

  // Sorts what was deferred and has room now that other lists have gone.
  absl::Status SortDeferred();
  // The items of deferred batches of layers for which seen(slot) is true.
  using Seen = std::function<bool(uint32_t)>;
  uint64_t CountDeferred(const Seen& seen) const;
  // Gives such batches lists, until EndPass, of what lies in the blocks that `within` draws. False if
  // there is no room for all of them: then none need have any, but if `some`, those have that have
  // room.
  absl::StatusOr<bool> SortWithin(const RegionGrid& within, const Seen& seen, bool some);
  void EndPass();

 protected:
  struct Member {
    uint32_t slot, first, count;  // items, one at least
    bool live;
  };
  struct Batch {
    uint32_t layer = 0;
    uint32_t count = 0, live = 0;  // items
    uint32_t regions_each = 0;
    bool mixed = false;
    Block items, colors;  // `colors` only if mixed
    // By region, as the kind has it.
    Block begin, base, offsets, regions, spans;
    RegionGrid within;  // what the lists are of, where their kind wants to know
    // There was no room for all that: of it there is `regions`, at the most.
    bool deferred = false;
    // Bytes that the lists took, or would have taken at least; and with what was needed to make them.
    uint64_t list_bytes = 0, sort_bytes = 0;
    std::vector<Member> members;
  };

  // `lists`: outlives the index. what: the items, for who reads an error. Sizes in bytes, of an item
  // and of its further colours.
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
  // ---- the kind. Each queues its kernels.
  // Regions that an item touches at most.
  virtual uint64_t MostRegions() const = 0;
  // batch.items and colors, of the list.
  virtual absl::Status Make(const TableEntry* table, const ItemList& list, const Batch& batch) = 0;
  // The entries put into the table, and the items made and sorted all at once; false, and nothing of
  // it, if they are too many, or if there is no room.
  virtual absl::StatusOr<bool> MakeFew(TableEntry*, const Arrivals&, Batch&, uint8_t*) {
    return false;
  }
  // `to` gets `count` items at `first` of the list, in which rows are those of `from`.
  virtual absl::Status Copy(const ItemList& list, uint64_t first, uint32_t count, const Batch& from,
                            const Batch& to) = 0;
  // Sorts the items by region, as fast as it goes, in as much memory as that takes; with
  // `region_dirty` marks the regions that have any.
  virtual absl::Status SortAll(Batch& batch, uint8_t* region_dirty) = 0;
  // Those in the blocks that `within` draws, in as little memory as it goes. `regions`: to be had in
  // place of the batch's own.
  virtual absl::Status SortExactly(Batch& batch, Block& regions, const RegionGrid& within,
                                   uint8_t* region_dirty) = 0;
  // Adds to `regions`, by block, a bit for each region that has any.
  virtual absl::Status FindRegions(const Batch& batch, uint64_t* regions) = 0;
  // Marks the regions that have any; of a deferred batch, by its `regions`.
  virtual absl::Status MarkAll(const Batch& batch, uint8_t* region_dirty) = 0;
  // Of items in rows, `count` in all, whose first is slot(d): marks the regions that they touch, or,
  // without `region_dirty`, has them draw nothing from now on.
  virtual absl::Status Touch(const ItemList& list, uint32_t count, const Batch& batch,
                             uint8_t* region_dirty) = 0;

  struct Place {
    uint64_t batch;  // its number
    size_t member;
  };
  // Items of a batch.
  struct Found {
    uint64_t count = 0;
    std::vector<Member> members;
  };

  absl::flat_hash_map<uint64_t, Found> Find(std::span<const uint32_t> slots) const;
  absl::Status TouchFound(const Batch& batch, Found& found, uint8_t* region_dirty);
  absl::Status TakeItems(Batch& batch);
  absl::Status MergeFrom(const std::vector<uint64_t>& numbers);
  static void DropLists(Batch& batch);  // but for `regions`
  // Whether a try at lists, which went as `status` says, took more than there is for them.
  bool WentOver(const absl::Status& status) const {
    return absl::IsResourceExhausted(status) || (status.ok() && lists_.KeepsTooMuch());
  }
  // Makes the items of a batch that comes, and sorts it.
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
  uint64_t used_ = 0;   // of the lists' pool, when SortDeferred last looked
  bool merge_ = false;  // something has changed since merging was last done or given up
  absl::flat_hash_map<uint64_t, Batch> batches_;  // by number
  absl::flat_hash_map<uint32_t, Place> places_;   // by slot of the table
};

}  // namespace voxeld::gpu::cuda
