// Which items may lie in which tiles, as a few sorted batches of pairs (types.h).
//
// Pairs have a budget. Drawables for whose pairs there is no room are deferred: their pairs are found
// anew in each pass of drawing, for the tiles that are drawn in it; or they are drawn without pairs, by
// threads that look through all their items.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/item_lists.h"
#include "gpu/cuda/list_budget.h"
#include "gpu/derived_bytes.h"

namespace voxeld::gpu::cuda {

// A drawable, as the index of pairs wants to know it.
struct PairedDrawable {
  uint32_t slot = 0, layer = 0, items = 0;  // slots of the table, and of layers
};

// Thread-bound; its calls queue work in the device's stream.
class PairIndex {
 public:
  // `lists`: outlives the index.
  PairIndex(Device& device, ListBudget& lists) : device_(device), lists_(lists) {}

  // Forgets all; or all but some drawables, which are deferred.
  void Clear() { Defer({}); }
  void Defer(std::vector<PairedDrawable> drawables);

  // Adds the pairs of drawables, in several goes, for as long as there is room, and marks the tiles of
  // layers that are drawn. Those of the first so many, which it answers, are all there; the others are
  // deferred, and of these not all tiles are marked. An error leaves some of the pairs.
  absl::StatusOr<size_t> Add(const TableEntry* table, const LayerLook* looks,
                             std::span<const PairedDrawable> drawables, const VolumeView& volume);
  // The pairs of all that a layer has, in place of those that it had before; a change to one layer leaves other batches alone.
  // At most kMostWhole items, of at most kMostWholeLayers layers. False: there is no room, and it has none now. Marks as Add.
  static constexpr uint32_t kMostWhole = 1u << 22, kMostWholeLayers = 8;
  absl::StatusOr<bool> SetWhole(uint32_t layer, const TableEntry* table, const LayerLook* looks,
                                const ItemList& list, uint32_t items, const VolumeView& volume);
  bool MayHaveWhole(uint32_t items) const {
    return items <= kMostWhole && whole_.size() < kMostWholeLayers;
  }
  // From now on these are as if they had been added.
  void Loosen(uint32_t layer);
  // Adds the pairs of what is deferred, if other lists have gone, for as long as there is room.
  absl::Status AddDeferred(const TableEntry* table, const VolumeView& volume);

  // Of drawables that are about to go: names those no more that are deferred.
  void Forget(std::span<const uint32_t> slots);
  // Drops the pairs of drawables that are not alive. An error leaves all as it was.
  absl::Status DropDead(const TableEntry* table, uint32_t tiles);

  // The items of deferred drawables of layers for which seen(slot) is true.
  using Seen = std::function<bool(uint32_t)>;
  uint64_t CountDeferred(const Seen& seen) const;
  // Passes over such drawables. SortWithin gives them pairs, until EndPass, with the tiles in the blocks
  // that `within` draws; false if there is no room for them: then they are unlisted().
  absl::Status BeginPasses(const Seen& seen);
  absl::StatusOr<bool> SortWithin(const TableEntry* table, const VolumeView& volume,
                                  const RegionGrid& within);
  void EndPass();
  void EndPasses();

  BatchList view() const;
  UnlistedItems unlisted() const { return unlisted_; }
  // In the host's memory.
  uint64_t host_bytes() const {
    return VectorBytes(batches_) + HashBytes(whole_) + VectorBytes(deferred_);
  }

 private:
  struct Batch {
    Block keys, values, rows;
    uint32_t pairs = 0;
  };
  // Deferred drawables that are seen, on the device.
  struct Passing {
    Block slots, firsts, layers;
    UnlistedItems items;
    uint64_t begin = 0;  // items that have their pairs
  };

  // Pairs of items from `begin` on; it answers how far they are there. Nothing is marked if there are no
  // looks.
  absl::Status AddItems(const TableEntry* table, const LayerLook* looks, const UploadedList& list,
                        const VolumeView& volume, uint64_t& begin);
  absl::Status AddPass(const TableEntry* table, const LayerLook* looks, const ItemList& list,
                       uint64_t begin, uint32_t items, const VolumeView& volume);
  // May have no pairs.
  absl::StatusOr<Batch> Paired(const TableEntry* table, const LayerLook* looks,
                               const ItemList& list, uint64_t begin, uint32_t items,
                               const VolumeView& volume);
  absl::StatusOr<Batch> PairedWithin(const TableEntry* table, const VolumeView& volume,
                                     const RegionGrid& within);
  // Room for so many pairs and for sorting them: keys, values, and as much again.
  struct Arrays {
    Block keys, values, keys2, values2;
  };
  absl::StatusOr<Arrays> ArraysFor(uint64_t pairs);
  // Sorts `pairs` pairs.
  absl::StatusOr<Batch> Sorted(Arrays arrays, uint32_t pairs, uint32_t tiles);
  absl::StatusOr<Block> Sums(const uint32_t* counts, uint32_t items);
  // Merges batches of like size, of which there are some; an error leaves all as it was, and want of
  // memory is none.
  absl::Status Merge(const TableEntry* table, uint32_t tiles);
  // The batches from `first` on become one, without what is dead.
  absl::Status MergeFrom(size_t first, const TableEntry* table, uint32_t tiles);

  Device& device_;
  ListBudget& lists_;
  std::vector<Batch> batches_;
  absl::flat_hash_map<uint32_t, Batch> whole_;  // of layers, by slot
  std::vector<PairedDrawable> deferred_;
  uint64_t skip_ = 0;          // items of the first of these that have their pairs
  uint64_t used_ = 0;          // of the lists' pool, when AddDeferred last looked
  Passing passing_;            // between BeginPasses and EndPasses
  std::optional<Batch> pass_;  // of the pass under way
  UnlistedItems unlisted_;     // in the pass under way
};

}  // namespace voxeld::gpu::cuda
