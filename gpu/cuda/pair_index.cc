#include "gpu/cuda/pair_index.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "absl/container/flat_hash_set.h"
#include "gpu/cuda/kernels.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kMostPass = 1u << 22, kLeastPass = 1024;  // items
constexpr uint64_t kMostPairs = 1ull << 31;                  // per batch

}  // namespace

void PairIndex::Defer(std::vector<PairedDrawable> drawables) {
  batches_.clear();
  whole_.clear();
  deferred_ = std::move(drawables);
  skip_ = 0;
  used_ = UINT64_MAX;  // there may be memory now
}

BatchList PairIndex::view() const {
  BatchList list;
  const auto add = [&](const Batch& batch) {
    list.batches[list.count++] = {batch.keys.as<uint64_t>(), batch.values.as<uint64_t>(),
                                  batch.rows.as<uint32_t>()};
  };
  for (const Batch& batch : batches_) add(batch);
  for (const auto& [layer, batch] : whole_) add(batch);
  if (pass_) add(*pass_);
  return list;
}

// ------------------------------------------------------------------------------------------ sorting

absl::StatusOr<Block> PairIndex::Sums(const uint32_t* counts, uint32_t items) {
  absl::StatusOr<Block> sums = lists_.pool.Acquire((size_t{items} + 1) * sizeof(uint64_t));
  if (!sums.ok()) return sums;
  size_t temp_bytes = 0;
  const auto sum = [&](void* temp) {
    return device_.Run("SumCounts", [&] {
      return SumCounts(temp, temp_bytes, counts, sums->as<uint64_t>(), items, device_.stream());
    });
  };
  if (absl::Status status = sum(nullptr); !status.ok()) return status;
  absl::StatusOr<Block> temp = lists_.pool.Acquire(temp_bytes);
  if (!temp.ok()) return temp;
  if (absl::Status status = sum(temp->as<void>()); !status.ok()) return status;
  return sums;
}

absl::StatusOr<PairIndex::Arrays> PairIndex::ArraysFor(uint64_t pairs) {
  if (pairs > kMostPairs) {
    return absl::ResourceExhaustedError("one pass over the scene has too many pairs");
  }
  Arrays arrays;
  for (Block* array : {&arrays.keys, &arrays.values, &arrays.keys2, &arrays.values2}) {
    absl::StatusOr<Block> made = lists_.pool.Acquire(pairs * sizeof(uint64_t));
    if (!made.ok()) return made.status();
    *array = *std::move(made);
  }
  return arrays;
}

absl::StatusOr<PairIndex::Batch> PairIndex::Sorted(Arrays arrays, uint32_t pairs, uint32_t tiles) {
  const int key_bits = static_cast<int>(kLayerBits) + std::bit_width(tiles);
  size_t temp_bytes = 0;
  bool swapped = false;
  const auto sort = [&](void* temp) {
    return device_.Run("SortPairs", [&] {
      return SortPairs(temp, temp_bytes, arrays.keys.as<uint64_t>(), arrays.keys2.as<uint64_t>(),
                       arrays.values.as<uint64_t>(), arrays.values2.as<uint64_t>(), pairs, key_bits,
                       swapped, device_.stream());
    });
  };
  if (absl::Status status = sort(nullptr); !status.ok()) return status;
  absl::StatusOr<Block> temp = lists_.pool.Acquire(temp_bytes);
  if (!temp.ok()) return temp.status();
  if (absl::Status status = sort(temp->as<void>()); !status.ok()) return status;
  Batch batch;
  batch.pairs = pairs;
  batch.keys = std::move(swapped ? arrays.keys2 : arrays.keys);
  batch.values = std::move(swapped ? arrays.values2 : arrays.values);
  absl::StatusOr<Block> rows = lists_.pool.Acquire((size_t{tiles} + 1) * sizeof(uint32_t));
  if (!rows.ok()) return rows.status();
  absl::Status status = device_.Run("FindRows", [&] {
    return FindRows(batch.keys.as<uint64_t>(), pairs, tiles, rows->as<uint32_t>(),
                    device_.stream());
  });
  if (!status.ok()) return status;
  batch.rows = *std::move(rows);
  return batch;
}

// ------------------------------------------------------------------------------------------ changes

absl::StatusOr<PairIndex::Batch> PairIndex::Paired(const TableEntry* table, const LayerLook* looks,
                                                   const ItemList& list, uint64_t begin,
                                                   uint32_t items, const VolumeView& volume) {
  absl::StatusOr<Block> counts = lists_.pool.Acquire(items * sizeof(uint32_t));
  if (!counts.ok()) return counts.status();
  absl::Status status = device_.Run("CountTiles", [&] {
    return CountTiles(table, list, begin, items, volume, counts->as<uint32_t>(), device_.stream());
  });
  if (!status.ok()) return status;
  const absl::StatusOr<Block> offsets = Sums(counts->as<uint32_t>(), items);
  if (!offsets.ok()) return offsets.status();
  const absl::StatusOr<uint64_t> pairs = device_.Read(offsets->as<uint64_t>() + items);
  if (!pairs.ok()) return pairs.status();
  if (*pairs == 0) return Batch();
  absl::StatusOr<Arrays> arrays = ArraysFor(*pairs);
  if (!arrays.ok()) return arrays.status();
  VolumeView marked = volume;
  if (looks == nullptr) marked.dirty = nullptr;
  status = device_.Run("FillPairs", [&] {
    return FillPairs(table, looks, list, begin, items, offsets->as<uint64_t>(), marked,
                     arrays->keys.as<uint64_t>(), arrays->values.as<uint64_t>(), device_.stream());
  });
  if (!status.ok()) return status;
  return Sorted(*std::move(arrays), static_cast<uint32_t>(*pairs), volume.grid.count());
}

absl::Status PairIndex::AddPass(const TableEntry* table, const LayerLook* looks,
                                const ItemList& list, uint64_t begin, uint32_t items,
                                const VolumeView& volume) {
  absl::Status status;
  // One batch is reserved for a pass of drawing.
  if (batches_.size() + whole_.size() + 1 >= kMaxBatches)
    status = MergeFrom(0, table, volume.grid.count());
  if (!status.ok()) return status;
  {
    absl::StatusOr<Batch> batch = Paired(table, looks, list, begin, items, volume);
    if (!batch.ok()) return batch.status();
    if (batch->pairs == 0) return absl::OkStatus();
    if (lists_.KeepsTooMuch()) {
      return absl::ResourceExhaustedError("lists that stay have had their share of the budget");
    }
    batches_.push_back(*std::move(batch));
  }
  return Merge(table, volume.grid.count());
}

absl::Status PairIndex::AddItems(const TableEntry* table, const LayerLook* looks,
                                 const UploadedList& list, const VolumeView& volume,
                                 uint64_t& begin) {
  uint32_t most = kMostPass;
  while (begin < list.items) {
    const auto pass = static_cast<uint32_t>(std::min<uint64_t>(most, list.items - begin));
    const absl::Status status = AddPass(table, looks, list.list, begin, pass, volume);
    if (status.ok()) {
      begin += pass;
      continue;
    }
    if (!absl::IsResourceExhausted(status)) return status;
    if (pass <= kLeastPass) break;
    most = std::max(kLeastPass, pass / 4);
  }
  return absl::OkStatus();
}

namespace {

absl::StatusOr<UploadedList> UploadDrawables(Device& device,
                                             std::span<const PairedDrawable> drawables) {
  std::vector<uint32_t> slots;
  std::vector<uint64_t> firsts = {0};
  for (const PairedDrawable& d : drawables) {
    slots.push_back(d.slot);
    firsts.push_back(firsts.back() + d.items);
  }
  return UploadList(device, slots, firsts);
}

// Returns how many drawables have all their items among the first `items`; subtracts those items,
// so that the rest remains.
size_t CountWhole(std::span<const PairedDrawable> drawables, uint64_t& items) {
  size_t whole = 0;
  while (whole < drawables.size() && drawables[whole].items <= items) {
    items -= drawables[whole++].items;
  }
  return whole;
}

}  // namespace

absl::StatusOr<size_t> PairIndex::Add(const TableEntry* table, const LayerLook* looks,
                                      std::span<const PairedDrawable> drawables,
                                      const VolumeView& volume) {
  const absl::StatusOr<UploadedList> list = UploadDrawables(device_, drawables);
  if (!list.ok()) return list.status();
  uint64_t done = 0;
  if (absl::Status status = AddItems(table, looks, *list, volume, done); !status.ok()) {
    return status;
  }
  const size_t whole = CountWhole(drawables, done);
  // If other drawables are deferred before it, the pairs of a part that is already there are made
  // twice, which does not change the result.
  if (deferred_.empty()) skip_ = done;
  deferred_.insert(deferred_.end(), drawables.begin() + static_cast<ptrdiff_t>(whole),
                   drawables.end());
  return whole;
}

absl::StatusOr<bool> PairIndex::SetWhole(uint32_t layer, const TableEntry* table,
                                         const LayerLook* looks, const ItemList& list,
                                         uint32_t items, const VolumeView& volume) {
  whole_.erase(layer);
  if (!MayHaveWhole(items)) return false;
  absl::Status status;
  if (batches_.size() + whole_.size() + 1 >= kMaxBatches) {
    status = MergeFrom(0, table, volume.grid.count());
  }
  absl::StatusOr<Batch> batch =
      status.ok() ? Paired(table, looks, list, 0, items, volume) : absl::StatusOr<Batch>(status);
  if (absl::IsResourceExhausted(batch.status())) return false;
  if (!batch.ok()) return batch.status();
  if (batch->pairs == 0) return true;
  if (lists_.KeepsTooMuch()) return false;
  whole_.emplace(layer, *std::move(batch));
  return true;
}

void PairIndex::Loosen(uint32_t layer) {
  const auto it = whole_.find(layer);
  if (it == whole_.end()) return;
  batches_.push_back(std::move(it->second));
  whole_.erase(it);
}

absl::Status PairIndex::AddDeferred(const TableEntry* table, const VolumeView& volume) {
  absl::Status status;
  if (!deferred_.empty() && lists_.pool.used() < used_) {
    const absl::StatusOr<UploadedList> list = UploadDrawables(device_, deferred_);
    if (absl::IsResourceExhausted(list.status())) return absl::OkStatus();  // try again later
    if (!list.ok()) return list.status();
    status = AddItems(table, nullptr, *list, volume, skip_);
    const size_t whole = CountWhole(deferred_, skip_);
    deferred_.erase(deferred_.begin(), deferred_.begin() + static_cast<ptrdiff_t>(whole));
  }
  used_ = lists_.pool.used();
  return status;
}

void PairIndex::Forget(std::span<const uint32_t> slots) {
  if (deferred_.empty()) return;
  const absl::flat_hash_set<uint32_t> gone(slots.begin(), slots.end());
  if (gone.contains(deferred_.front().slot)) skip_ = 0;
  std::erase_if(deferred_, [&](const PairedDrawable& d) { return gone.contains(d.slot); });
}

absl::Status PairIndex::MergeFrom(size_t first, const TableEntry* table, uint32_t tiles) {
  uint64_t pairs = 0;
  for (size_t b = first; b < batches_.size(); ++b) pairs += batches_[b].pairs;
  if (pairs == 0) {
    batches_.resize(first);
    return absl::OkStatus();
  }
  absl::StatusOr<Arrays> arrays = ArraysFor(pairs);
  if (!arrays.ok()) return arrays.status();
  const auto count = static_cast<uint32_t>(pairs);
  uint64_t at = 0;
  for (size_t b = first; b < batches_.size(); ++b) {
    const Batch& batch = batches_[b];
    const auto copy = [&](const Block& to, const Block& from) {
      return device_.Run("cudaMemcpyAsync", [&] {
        return cudaMemcpyAsync(to.as<uint64_t>() + at, from.as<uint64_t>(),
                               batch.pairs * sizeof(uint64_t), cudaMemcpyDeviceToDevice,
                               device_.stream());
      });
    };
    absl::Status status = copy(arrays->keys, batch.keys);
    if (status.ok()) status = copy(arrays->values, batch.values);
    if (!status.ok()) return status;
    at += batch.pairs;
  }
  const absl::StatusOr<Block> flags = lists_.pool.Acquire(pairs * sizeof(uint32_t));
  if (!flags.ok()) return flags.status();
  absl::Status status = device_.Run("FlagLive", [&] {
    return FlagLive(table, arrays->values.as<uint64_t>(), count, flags->as<uint32_t>(),
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
    return PickLive(arrays->keys.as<uint64_t>(), arrays->values.as<uint64_t>(),
                    flags->as<uint32_t>(), offsets->as<uint64_t>(), count,
                    arrays->keys2.as<uint64_t>(), arrays->values2.as<uint64_t>(), device_.stream());
  });
  if (!status.ok()) return status;
  std::swap(arrays->keys, arrays->keys2);
  std::swap(arrays->values, arrays->values2);
  absl::StatusOr<Batch> merged = Sorted(*std::move(arrays), static_cast<uint32_t>(*live), tiles);
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
  // It is correct to have as many batches as fit; the remaining drawables are deferred.
  return absl::IsResourceExhausted(status) ? absl::OkStatus() : status;
}

absl::Status PairIndex::DropDead(const TableEntry* table, uint32_t tiles) {
  return batches_.empty() ? absl::OkStatus() : MergeFrom(0, table, tiles);
}

// ------------------------------------------------------------------------------------------ passes

uint64_t PairIndex::CountDeferred(const Seen& seen) const {
  uint64_t items = 0;
  for (const PairedDrawable& d : deferred_) items += seen(d.layer) ? d.items : 0;
  return items;
}

absl::Status PairIndex::BeginPasses(const Seen& seen) {
  passing_ = {};
  std::vector<uint32_t> slots, layers;
  std::vector<uint64_t> firsts = {0};
  for (const PairedDrawable& d : deferred_) {
    if (!seen(d.layer)) continue;
    if (&d == &deferred_.front()) passing_.begin = skip_;
    slots.push_back(d.slot);
    firsts.push_back(firsts.back() + d.items);
    layers.push_back(d.layer);
  }
  if (slots.empty()) return absl::OkStatus();
  std::sort(layers.begin(), layers.end());
  layers.erase(std::unique(layers.begin(), layers.end()), layers.end());
  absl::StatusOr<Block> block = device_.Upload(slots.data(), slots.size());
  if (!block.ok()) return block.status();
  passing_.slots = *std::move(block);
  block = device_.Upload(firsts.data(), firsts.size());
  if (!block.ok()) return block.status();
  passing_.firsts = *std::move(block);
  block = device_.Upload(layers.data(), layers.size());
  if (!block.ok()) return block.status();
  passing_.layers = *std::move(block);
  passing_.items = {.slots = passing_.slots.as<uint32_t>(),
                    .firsts = passing_.firsts.as<uint64_t>(),
                    .layers = passing_.layers.as<uint32_t>(),
                    .count = static_cast<uint32_t>(slots.size()),
                    .layer_count = static_cast<uint32_t>(layers.size()),
                    .items = firsts.back()};
  return absl::OkStatus();
}

absl::StatusOr<PairIndex::Batch> PairIndex::PairedWithin(const TableEntry* table,
                                                         const VolumeView& volume,
                                                         const RegionGrid& within) {
  ItemList list;
  list.slots = passing_.items.slots;
  list.firsts = passing_.items.firsts;
  list.count = passing_.items.count;
  const absl::StatusOr<Block> count = lists_.pool.Acquire(sizeof(uint64_t));
  if (!count.ok()) return count.status();
  Arrays arrays;
  const auto append = [&](uint64_t room) {
    absl::Status status = device_.Zero(count->as<void>(), sizeof(uint64_t));
    if (!status.ok()) return status;
    return device_.Run("AppendPairs", [&] {
      return AppendPairs(table, list, passing_.begin, passing_.items.items, volume, within,
                         arrays.keys.as<uint64_t>(), arrays.values.as<uint64_t>(), room,
                         count->as<uint64_t>(), device_.stream());
    });
  };
  if (absl::Status status = append(0); !status.ok()) return status;
  const absl::StatusOr<uint64_t> pairs = device_.Read(count->as<uint64_t>());
  if (!pairs.ok()) return pairs.status();
  if (*pairs == 0) return Batch();
  absl::StatusOr<Arrays> made = ArraysFor(*pairs);
  if (!made.ok()) return made.status();
  arrays = *std::move(made);
  if (absl::Status status = append(*pairs); !status.ok()) return status;
  return Sorted(std::move(arrays), static_cast<uint32_t>(*pairs), volume.grid.count());
}

absl::StatusOr<bool> PairIndex::SortWithin(const TableEntry* table, const VolumeView& volume,
                                           const RegionGrid& within) {
  if (passing_.items.items == 0) return true;
  absl::StatusOr<Batch> batch = PairedWithin(table, volume, within);
  if (absl::IsResourceExhausted(batch.status())) {
    unlisted_ = passing_.items;
    return false;
  }
  if (!batch.ok()) return batch.status();
  if (batch->pairs > 0) pass_ = *std::move(batch);
  return true;
}

void PairIndex::EndPass() {
  pass_.reset();
  unlisted_ = {};
}

void PairIndex::EndPasses() {
  EndPass();
  passing_ = {};
}

}  // namespace voxeld::gpu::cuda
