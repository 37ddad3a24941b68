// Which items may lie in which tiles, as a few sorted batches of pairs (types.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/types.h"

namespace voxeld::gpu::cuda {

// Thread-bound; its calls queue work in the device's stream.
class PairIndex {
 public:
  explicit PairIndex(Device& device) : device_(device) {}

  void Clear() { batches_.clear(); }

  // Adds the pairs of `items` items; marks tiles of visible layers. What does not fit the device at
  // once goes in several passes; ResourceExhausted if even a small one does not (then some may have
  // been added).
  absl::Status Add(const TableEntry* table, const LayerLook* looks, const ItemList& list,
                   uint64_t items, const VolumeView& volume);

  // Drops the pairs of drawables that are not alive. An error leaves all as it was.
  absl::Status DropDead(const TableEntry* table, uint32_t tiles);

  // Merges batches of like size; an error leaves all as it was, and want of memory is none.
  absl::Status Merge(const TableEntry* table, uint32_t tiles);

  BatchList view() const;

 private:
  struct Batch {
    Block keys, values, rows;
    uint32_t pairs = 0;
  };

  absl::Status AddPass(const TableEntry* table, const LayerLook* looks, const ItemList& list,
                       uint64_t begin, uint32_t items, const VolumeView& volume);
  // Sorts `pairs` pairs; keys2 and values2 are as large.
  absl::StatusOr<Batch> Sorted(Block keys, Block values, Block keys2, Block values2, uint32_t pairs,
                               uint32_t tiles);
  absl::StatusOr<Block> Sums(const uint32_t* counts, uint32_t items);
  // The batches from `first` on become one, without what is dead.
  absl::Status MergeFrom(size_t first, const TableEntry* table, uint32_t tiles);

  Device& device_;
  std::vector<Batch> batches_;
  uint32_t pass_items_ = 1u << 22;
};

}  // namespace voxeld::gpu::cuda
