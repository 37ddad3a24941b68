// The items that may lie in each tile, as a few sorted batches of pairs (types.h).
//
// Pairs have a budget. Drawables whose pairs do not fit are deferred: their pairs are found again
// in each pass of drawing, for the tiles that are drawn in it; or they are drawn without pairs, by
// threads that test all their items.
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

// A drawable's data for the index of pairs.
struct PairedDrawable {
  uint32_t slot = 0, layer = 0, items = 0;  // slots of the table, and of layers
};

// Thread-bound. Calls queue work in the device's stream.
class PairIndex {
 public:
  // `lists` must outlive the index.
  PairIndex(Device& device, ListBudget& lists) : device_(device), lists_(lists) {}

  // Clears the index; or replaces its contents by some drawables, which are deferred.
  void Clear() { Defer({}); }
  void Defer(std::vector<PairedDrawable> drawables);

  // Adds the pairs of drawables, in several steps, while there is memory, and marks the tiles of
  // layers that are drawn. Returns the number of drawables, from the first on, whose pairs are
  // complete; the others are deferred, and not all of their tiles are marked. An error leaves some
  // of the pairs.
  absl::StatusOr<size_t> Add(const TableEntry* table, const LayerLook* looks,
                             std::span<const PairedDrawable> drawables, const VolumeView& volume);
  // Sets the pairs of all drawables of a layer, in place of its previous ones; a change to one
  // layer does not affect other batches. At most kMostWhole items, of at most kMostWholeLayers
  // layers. Returns false if there is no memory, and the layer then has no pairs. Marks tiles as
  // Add does.
  static constexpr uint32_t kMostWhole = 1u << 22, kMostWholeLayers = 8;
  absl::StatusOr<bool> SetWhole(uint32_t layer, const TableEntry* table, const LayerLook* looks,
                                const ItemList& list, uint32_t items, const VolumeView& volume);
  bool MayHaveWhole(uint32_t items) const {
    return items <= kMostWhole && whole_.size() < kMostWholeLayers;
  }
  // From now on the layer's pairs are treated as if they had been added with Add.
  void Loosen(uint32_t layer);
  // Adds the pairs of deferred drawables, if other lists have been released, while there is memory.
  absl::Status AddDeferred(const TableEntry* table, const VolumeView& volume);

  // Called for drawables that are about to be removed: drops the deferred ones.
  void Forget(std::span<const uint32_t> slots);
  // Drops the pairs of drawables that are not alive. An error leaves the index as it was.
  absl::Status DropDead(const TableEntry* table, uint32_t tiles);

  // Handles the items of deferred drawables, of layers for which seen(slot) is true.
  using Seen = std::function<bool(uint32_t)>;
  uint64_t CountDeferred(const Seen& seen) const;
  // Starts passes over such drawables. SortWithin gives them pairs, until EndPass, with the tiles
  // in the blocks that `within` draws; it returns false if there is no memory for them: then they
  // are unlisted().
  absl::Status BeginPasses(const Seen& seen);
  absl::StatusOr<bool> SortWithin(const TableEntry* table, const VolumeView& volume,
                                  const RegionGrid& within);
  void EndPass();
  void EndPasses();

  BatchList view() const;
  UnlistedItems unlisted() const { return unlisted_; }
  // Returns the bytes in the host's memory.
  uint64_t host_bytes() const {
    return VectorBytes(batches_) + HashBytes(whole_) + VectorBytes(deferred_);
  }

 private:
  struct Batch {
    Block keys, values, rows;
    uint32_t pairs = 0;
  };
  // Deferred drawables that are visible, on the device.
  struct Passing {
    Block slots, firsts, layers;
    UnlistedItems items;
    uint64_t begin = 0;  // items that already have pairs
  };

  // Adds the pairs of items from `begin` on, and advances `begin` past those that were added. Marks
  // nothing if `looks` is null.
  absl::Status AddItems(const TableEntry* table, const LayerLook* looks, const UploadedList& list,
                        const VolumeView& volume, uint64_t& begin);
  absl::Status AddPass(const TableEntry* table, const LayerLook* looks, const ItemList& list,
                       uint64_t begin, uint32_t items, const VolumeView& volume);
  // The result may have no pairs.
  absl::StatusOr<Batch> Paired(const TableEntry* table, const LayerLook* looks,
                               const ItemList& list, uint64_t begin, uint32_t items,
                               const VolumeView& volume);
  absl::StatusOr<Batch> PairedWithin(const TableEntry* table, const VolumeView& volume,
                                     const RegionGrid& within);
  // Memory for pairs and for sorting them: keys, values, and the same again.
  struct Arrays {
    Block keys, values, keys2, values2;
  };
  absl::StatusOr<Arrays> ArraysFor(uint64_t pairs);
  // Sorts `pairs` pairs.
  absl::StatusOr<Batch> Sorted(Arrays arrays, uint32_t pairs, uint32_t tiles);
  absl::StatusOr<Block> Sums(const uint32_t* counts, uint32_t items);
  // Merges batches of similar size. An error leaves the index as it was; running out of memory is
  // not an error.
  absl::Status Merge(const TableEntry* table, uint32_t tiles);
  // Merges the batches from `first` on into one, without dead drawables.
  absl::Status MergeFrom(size_t first, const TableEntry* table, uint32_t tiles);

  Device& device_;
  ListBudget& lists_;
  std::vector<Batch> batches_;
  absl::flat_hash_map<uint32_t, Batch> whole_;  // of whole layers, by slot
  std::vector<PairedDrawable> deferred_;
  uint64_t skip_ = 0;          // items of the first ones that already have pairs
  uint64_t used_ = 0;          // of the lists' pool, when AddDeferred last tried
  Passing passing_;            // between BeginPasses and EndPasses
  std::optional<Batch> pass_;  // of the current pass
  UnlistedItems unlisted_;     // in the current pass
};

}  // namespace voxeld::gpu::cuda
