#include "gpu/cuda/pair_index.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "gpu/cuda/kernels.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kLeastPass = 1024;        // items
constexpr uint64_t kMostPairs = 1ull << 31;  // of a batch

}  // namespace

BatchList PairIndex::view() const {
  BatchList list;
  for (const Batch& batch : batches_) {
    list.batches[list.count++] = {batch.keys.as<uint64_t>(), batch.values.as<uint64_t>(),
                                  batch.rows.as<uint32_t>()};
  }
  return list;
}

absl::StatusOr<Block> PairIndex::Sums(const uint32_t* counts, uint32_t items) {
  absl::StatusOr<Block> sums = device_.pool().Acquire((size_t{items} + 1) * sizeof(uint64_t));
  if (!sums.ok()) return sums;
  size_t temp_bytes = 0;
  const auto sum = [&](void* temp) {
    return device_.Run("SumCounts", [&] {
      return SumCounts(temp, temp_bytes, counts, sums->as<uint64_t>(), items, device_.stream());
    });
  };
  if (absl::Status status = sum(nullptr); !status.ok()) return status;
  absl::StatusOr<Block> temp = device_.pool().Acquire(temp_bytes);
  if (!temp.ok()) return temp;
  if (absl::Status status = sum(temp->as<void>()); !status.ok()) return status;
  return sums;
}

absl::StatusOr<PairIndex::Batch> PairIndex::Sorted(Block keys, Block values, Block keys2,
                                                   Block values2, uint32_t pairs, uint32_t tiles) {
  const int key_bits = static_cast<int>(kLayerBits) + std::bit_width(tiles);
  size_t temp_bytes = 0;
  bool swapped = false;
  const auto sort = [&](void* temp) {
    return device_.Run("SortPairs", [&] {
      return SortPairs(temp, temp_bytes, keys.as<uint64_t>(), keys2.as<uint64_t>(),
                       values.as<uint64_t>(), values2.as<uint64_t>(), pairs, key_bits, swapped,
                       device_.stream());
    });
  };
  if (absl::Status status = sort(nullptr); !status.ok()) return status;
  absl::StatusOr<Block> temp = device_.pool().Acquire(temp_bytes);
  if (!temp.ok()) return temp.status();
  if (absl::Status status = sort(temp->as<void>()); !status.ok()) return status;
  Batch batch;
  batch.pairs = pairs;
  batch.keys = swapped ? std::move(keys2) : std::move(keys);
  batch.values = swapped ? std::move(values2) : std::move(values);
  absl::StatusOr<Block> rows = device_.pool().Acquire((size_t{tiles} + 1) * sizeof(uint32_t));
  if (!rows.ok()) return rows.status();
  absl::Status status = device_.Run("FindRows", [&] {
    return FindRows(batch.keys.as<uint64_t>(), pairs, tiles, rows->as<uint32_t>(),
                    device_.stream());
  });
  if (!status.ok()) return status;
  batch.rows = *std::move(rows);
  return batch;
}

absl::Status PairIndex::AddPass(const TableEntry* table, const LayerLook* looks,
                                const ItemList& list, uint64_t begin, uint32_t items,
                                const VolumeView& volume) {
  absl::Status status;
  if (batches_.size() == kMaxBatches) status = MergeFrom(0, table, volume.grid.count());
  if (!status.ok()) return status;
  absl::StatusOr<Block> counts = device_.pool().Acquire(items * sizeof(uint32_t));
  if (!counts.ok()) return counts.status();
  status = device_.Run("CountTiles", [&] {
    return CountTiles(table, list, begin, items, volume, counts->as<uint32_t>(), device_.stream());
  });
  if (!status.ok()) return status;
  const absl::StatusOr<Block> offsets = Sums(counts->as<uint32_t>(), items);
  if (!offsets.ok()) return offsets.status();
  const absl::StatusOr<uint64_t> pairs = device_.Read(offsets->as<uint64_t>() + items);
  if (!pairs.ok()) return pairs.status();
  if (*pairs == 0) return absl::OkStatus();
  if (*pairs > kMostPairs) {
    return absl::ResourceExhaustedError("one pass over the scene has too many pairs");
  }
  Block arrays[4];
  for (Block& array : arrays) {
    absl::StatusOr<Block> made = device_.pool().Acquire(*pairs * sizeof(uint64_t));
    if (!made.ok()) return made.status();
    array = *std::move(made);
  }
  status = device_.Run("FillPairs", [&] {
    return FillPairs(table, looks, list, begin, items, offsets->as<uint64_t>(), volume,
                     arrays[0].as<uint64_t>(), arrays[1].as<uint64_t>(), device_.stream());
  });
  if (!status.ok()) return status;
  absl::StatusOr<Batch> batch =
      Sorted(std::move(arrays[0]), std::move(arrays[1]), std::move(arrays[2]), std::move(arrays[3]),
             static_cast<uint32_t>(*pairs), volume.grid.count());
  if (!batch.ok()) return batch.status();
  batches_.push_back(*std::move(batch));
  return Merge(table, volume.grid.count());
}

absl::Status PairIndex::Add(const TableEntry* table, const LayerLook* looks, const ItemList& list,
                            uint64_t items, const VolumeView& volume) {
  for (uint64_t begin = 0; begin < items;) {
    const auto pass = static_cast<uint32_t>(std::min<uint64_t>(pass_items_, items - begin));
    const absl::Status status = AddPass(table, looks, list, begin, pass, volume);
    if (absl::IsResourceExhausted(status) && pass > kLeastPass) {
      pass_items_ = std::max(kLeastPass, pass / 4);
      continue;
    }
    if (!status.ok()) return status;
    begin += pass;
  }
  return absl::OkStatus();
}

absl::Status PairIndex::MergeFrom(size_t first, const TableEntry* table, uint32_t tiles) {
  uint64_t pairs = 0;
  for (size_t b = first; b < batches_.size(); ++b) pairs += batches_[b].pairs;
  if (pairs > kMostPairs) {
    return absl::ResourceExhaustedError("the index of tiles has too many pairs");
  }
  Block arrays[4];
  for (Block& array : arrays) {
    absl::StatusOr<Block> made = device_.pool().Acquire(pairs * sizeof(uint64_t));
    if (!made.ok()) return made.status();
    array = *std::move(made);
  }
  const auto count = static_cast<uint32_t>(pairs);
  uint64_t at = 0;
  for (size_t b = first; b < batches_.size(); ++b) {
    const Batch& batch = batches_[b];
    for (const auto& [to, from] :
         {std::pair(&arrays[0], &batch.keys), {&arrays[1], &batch.values}}) {
      absl::Status status = device_.Run("cudaMemcpyAsync", [&] {
        return cudaMemcpyAsync(to->as<uint64_t>() + at, from->as<uint64_t>(),
                               batch.pairs * sizeof(uint64_t), cudaMemcpyDeviceToDevice,
                               device_.stream());
      });
      if (!status.ok()) return status;
    }
    at += batch.pairs;
  }
  const absl::StatusOr<Block> flags = device_.pool().Acquire(pairs * sizeof(uint32_t));
  if (!flags.ok()) return flags.status();
  absl::Status status = device_.Run("FlagLive", [&] {
    return FlagLive(table, arrays[1].as<uint64_t>(), count, flags->as<uint32_t>(),
                    device_.stream());
  });
  if (!status.ok()) return status;
  const absl::StatusOr<Block> offsets = Sums(flags->as<uint32_t>(), count);
  if (!offsets.ok()) return offsets.status();
  const absl::StatusOr<uint64_t> live = device_.Read(offsets->as<uint64_t>() + count);
  if (!live.ok()) return live.status();
  if (*live == 0) {
    batches_.resize(first);
    return absl::OkStatus();
  }
  status = device_.Run("PickLive", [&] {
    return PickLive(arrays[0].as<uint64_t>(), arrays[1].as<uint64_t>(), flags->as<uint32_t>(),
                    offsets->as<uint64_t>(), count, arrays[2].as<uint64_t>(),
                    arrays[3].as<uint64_t>(), device_.stream());
  });
  if (!status.ok()) return status;
  absl::StatusOr<Batch> merged =
      Sorted(std::move(arrays[2]), std::move(arrays[3]), std::move(arrays[0]), std::move(arrays[1]),
             static_cast<uint32_t>(*live), tiles);
  if (!merged.ok()) return merged.status();
  batches_.resize(first);
  batches_.push_back(*std::move(merged));
  return absl::OkStatus();
}

absl::Status PairIndex::Merge(const TableEntry* table, uint32_t tiles) {
  size_t first = batches_.size() - 1;
  uint64_t pairs = batches_.back().pairs;
  while (first > 0 && batches_[first - 1].pairs <= 2 * pairs) pairs += batches_[--first].pairs;
  if (first + 1 == batches_.size()) return absl::OkStatus();
  const absl::Status status = MergeFrom(first, table, tiles);
  // As many batches as there is room for are in order; the next pass makes room or is refused.
  return absl::IsResourceExhausted(status) ? absl::OkStatus() : status;
}

absl::Status PairIndex::DropDead(const TableEntry* table, uint32_t tiles) {
  return batches_.empty() ? absl::OkStatus() : MergeFrom(0, table, tiles);
}

}  // namespace voxeld::gpu::cuda
