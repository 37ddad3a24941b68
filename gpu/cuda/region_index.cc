#include "gpu/cuda/region_index.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cuda/item_lists.h"
#include "gpu/cuda/kernels.h"
#include "gpu/derived_bytes.h"

namespace voxeld::gpu::cuda {

void RegionIndex::Reset(const TileGrid& grid, std::span<const uint8_t> owned) {
  batches_.clear();
  places_.clear();
  grid_ = RegionGrid::Of(grid);
  int32_t lo[3] = {INT32_MAX, INT32_MAX, INT32_MAX}, hi[3] = {};
  for (uint32_t tile = 0; tile < grid.count(); ++tile) {
    if (owned[tile] == kNotOwned) continue;
    int32_t at[3];
    grid.Coordinates(tile, at);
    for (int a = 0; a < 3; ++a) {
      const int32_t block = at[a] * kTileSize >> (RegionBits(a) + kBlockBits);
      lo[a] = std::min(lo[a], block);
      hi[a] = std::max(hi[a], block + 1);
    }
  }
  for (int a = 0; a < 3; ++a) {
    grid_.drawn_lo[a] = std::min(lo[a], hi[a]);  // if empty, nothing is drawn
    grid_.drawn_hi[a] = hi[a];
  }
  merge_ = false;
  // For any items, their places can then be counted in 32 bits.
  most_items_ = uint64_t{0xFFFFFFFFu} / MostRegions();
}

uint64_t RegionIndex::live() const {
  uint64_t items = 0;
  for (const auto& [number, batch] : batches_) items += batch.live;
  return items;
}

uint64_t RegionIndex::host_bytes() const {
  uint64_t bytes = HashBytes(batches_) + HashBytes(places_);
  for (const auto& [number, batch] : batches_) bytes += VectorBytes(batch.members);
  return bytes;
}

absl::flat_hash_set<uint32_t> RegionIndex::Layers() const {
  absl::flat_hash_set<uint32_t> layers;
  for (const auto& [number, batch] : batches_) layers.insert(batch.layer);
  return layers;
}

absl::Status RegionIndex::TakeItems(Batch& batch) {
  absl::StatusOr<Block> items =
      device_.pool().Acquire(std::max<size_t>(1, batch.count) * item_size_);
  if (!items.ok()) return items.status();
  batch.items = *std::move(items);
  if (!batch.mixed) return absl::OkStatus();
  absl::StatusOr<Block> colors =
      device_.pool().Acquire(std::max<size_t>(1, batch.count) * color_size_);
  if (!colors.ok()) return colors.status();
  batch.colors = *std::move(colors);
  return absl::OkStatus();
}

// ------------------------------------------------------------------------------------------ changes

absl::Status RegionIndex::MakeAndSort(TableEntry* table, const Arrivals& arrivals, Batch& batch,
                                      uint8_t* region_dirty) {
  const absl::StatusOr<bool> made = MakeFew(table, arrivals, batch, region_dirty);
  if (!made.ok()) return made.status();
  if (*made) {
    if (!lists_.KeepsTooMuch()) return absl::OkStatus();
  } else {
    absl::Status status;
    if (arrivals.entries != nullptr) {
      status = device_.Run("PutEntries", [&] {
        return PutFewEntries(table, *arrivals.entries, static_cast<uint32_t>(arrivals.slots.size()),
                             device_.stream());
      });
    }
    if (status.ok()) status = Make(table, arrivals.list, batch);
    if (!status.ok()) return status;
  }
  return Sort(batch, region_dirty);
}

absl::Status RegionIndex::Add(TableEntry* table, const Arrivals& arrivals, uint8_t* region_dirty) {
  const uint64_t count = arrivals.first.back();
  if (count == 0) return absl::OkStatus();
  Batch batch;
  batch.layer = arrivals.layer;
  batch.count = batch.live = static_cast<uint32_t>(count);
  batch.regions_each = arrivals.regions_each;
  batch.mixed = arrivals.mixed;
  absl::Status status = TakeItems(batch);
  if (status.ok()) {
    status = MakeAndSort(table, arrivals, batch, arrivals.drawn ? region_dirty : nullptr);
  }
  if (!status.ok()) return status;
  const uint64_t number = next_number_++;
  for (size_t i = 0; i < arrivals.slots.size(); ++i) {
    if (arrivals.first[i] == arrivals.first[i + 1]) continue;  // it has no items
    places_[arrivals.slots[i]] = {number, batch.members.size()};
    batch.members.push_back({arrivals.slots[i], static_cast<uint32_t>(arrivals.first[i]),
                             static_cast<uint32_t>(arrivals.first[i + 1] - arrivals.first[i]),
                             true});
  }
  batches_.emplace(number, std::move(batch));
  merge_ = true;
  return absl::OkStatus();
}

absl::flat_hash_map<uint64_t, RegionIndex::Found> RegionIndex::Find(
    std::span<const uint32_t> slots) const {
  absl::flat_hash_map<uint64_t, Found> all;
  for (const uint32_t slot : slots) {
    const auto it = places_.find(slot);
    if (it == places_.end()) continue;
    const Member& member = batches_.at(it->second.batch).members[it->second.member];
    Found& found = all[it->second.batch];
    found.count += member.count;
    found.members.push_back(member);
  }
  return all;
}

// Marks, or kills, some items of a batch.
absl::Status RegionIndex::TouchFound(const Batch& batch, Found& found, uint8_t* region_dirty) {
  std::sort(found.members.begin(), found.members.end(),
            [](const Member& a, const Member& b) { return a.first < b.first; });
  std::vector<uint32_t> from;
  std::vector<uint64_t> first;
  uint64_t total = 0;
  uint32_t end = 0;
  for (const Member& member : found.members) {
    if (from.empty() || member.first != end) {
      from.push_back(member.first);
      first.push_back(total);
    }
    end = member.first + member.count;
    total += member.count;
  }
  first.push_back(total);
  const absl::StatusOr<UploadedList> rows = UploadList(device_, from, first);
  if (!rows.ok()) return rows.status();
  return Touch(rows->list, static_cast<uint32_t>(total), batch, region_dirty);
}

absl::Status RegionIndex::Mark(std::span<const uint32_t> slots, uint8_t* region_dirty) {
  for (auto& [number, found] : Find(slots)) {
    const Batch& batch = batches_.at(number);
    absl::Status status = found.count < batch.live ? TouchFound(batch, found, region_dirty)
                                                   : MarkAll(batch, region_dirty);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status RegionIndex::Drop(std::span<const uint32_t> slots) {
  auto all = Find(slots);
  for (auto& [number, found] : all) {
    const Batch& batch = batches_.at(number);
    if (found.count == batch.live) continue;
    if (absl::Status status = TouchFound(batch, found, nullptr); !status.ok()) return status;
  }
  for (const auto& [number, found] : all) {
    batches_.at(number).live -= static_cast<uint32_t>(found.count);
  }
  for (const uint32_t slot : slots) {
    const auto it = places_.find(slot);
    if (it == places_.end()) continue;
    batches_.at(it->second.batch).members[it->second.member].live = false;
    places_.erase(it);
  }
  merge_ |= !all.empty();
  absl::erase_if(batches_, [](const auto& entry) { return entry.second.live == 0; });
  return absl::OkStatus();
}

// ------------------------------------------------------------------------------------------ sorting

void RegionIndex::DropLists(Batch& batch) {
  for (Block* block : {&batch.begin, &batch.base, &batch.offsets, &batch.spans}) *block = Block();
}

absl::Status RegionIndex::Sort(Batch& batch, uint8_t* region_dirty) {
  absl::Status status = SortAll(batch, region_dirty);
  if (WentOver(status)) {
    DropLists(batch);
    status = SortExactly(batch, batch.regions, grid_, region_dirty);
  }
  batch.deferred = false;
  if (!WentOver(status)) return status;
  DropLists(batch);
  return Defer(batch, region_dirty);
}

// An error leaves the batch as it was, unless marking failed.
absl::Status RegionIndex::Defer(Batch& batch, uint8_t* region_dirty) {
  absl::StatusOr<Block> regions = device_.Zeros(grid_.block_count() * sizeof(uint64_t));
  if (!regions.ok()) return regions.status();
  absl::Status status = FindRegions(batch, regions->as<uint64_t>());
  if (!status.ok()) return status;
  DropLists(batch);
  batch.regions = *std::move(regions);
  batch.deferred = true;
  return region_dirty != nullptr ? MarkAll(batch, region_dirty) : status;
}

absl::Status RegionIndex::SortDeferred() {
  const Pool& pool = lists_.pool;
  if (pool.used() < used_) {
    for (auto& [number, batch] : batches_) {
      if (!batch.deferred || pool.used() + batch.list_bytes > lists_.most_kept ||
          pool.used() + batch.sort_bytes > pool.limit()) {
        continue;
      }
      Block regions;
      const absl::Status status = SortExactly(batch, regions, grid_, nullptr);
      if (status.ok() && !lists_.KeepsTooMuch()) {
        batch.regions = std::move(regions);
        batch.deferred = false;
        continue;
      }
      DropLists(batch);
      if (!status.ok() && !absl::IsResourceExhausted(status)) return status;
    }
  }
  used_ = pool.used();
  return absl::OkStatus();
}

uint64_t RegionIndex::CountDeferred(const Seen& seen) const {
  uint64_t items = 0;
  for (const auto& [number, batch] : batches_) {
    if (batch.deferred && seen(batch.layer)) items += batch.count;
  }
  return items;
}

absl::StatusOr<bool> RegionIndex::SortWithin(const RegionGrid& within, const Seen& seen,
                                             bool some) {
  RegionGrid drawn = within;
  for (int a = 0; a < 3; ++a) {
    drawn.drawn_lo[a] = std::max(within.drawn_lo[a], grid_.drawn_lo[a]);
    drawn.drawn_hi[a] = std::min(within.drawn_hi[a], grid_.drawn_hi[a]);
  }
  bool all = true;
  for (auto& [number, batch] : batches_) {
    if (!batch.deferred || !seen(batch.layer)) continue;
    Block regions;  // the batch's own cover more
    const uint64_t list_bytes = batch.list_bytes, sort_bytes = batch.sort_bytes;
    const absl::Status status = SortExactly(batch, regions, drawn, nullptr);
    batch.list_bytes = list_bytes;
    batch.sort_bytes = sort_bytes;
    if (status.ok()) continue;
    DropLists(batch);
    all = false;
    if (!absl::IsResourceExhausted(status)) return status;
    if (!some) return false;
  }
  return all;
}

void RegionIndex::EndPass() {
  for (auto& [number, batch] : batches_) {
    if (batch.deferred) DropLists(batch);
  }
}

// ------------------------------------------------------------------------------------------ merging

absl::Status RegionIndex::MergeFrom(const std::vector<uint64_t>& numbers) {
  Batch merged;
  merged.layer = batches_.at(numbers.front()).layer;
  struct Range {
    const Batch* batch;
    std::vector<uint32_t> from;
    std::vector<uint64_t> first;  // in the merged batch; the end is last
  };
  std::vector<Range> ranges;
  for (const uint64_t number : numbers) {
    const Batch& batch = batches_.at(number);
    merged.mixed |= batch.mixed;
    merged.regions_each = std::max(merged.regions_each, batch.regions_each);
    Range range{&batch, {}, {merged.count}};
    uint32_t end = 0;  // of the last range, in the old batch
    for (const Member& member : batch.members) {
      if (!member.live) continue;
      merged.members.push_back({member.slot, merged.count, member.count, true});
      if (range.from.empty() || member.first != end) {
        if (!range.from.empty()) range.first.push_back(merged.count);
        range.from.push_back(member.first);
      }
      end = member.first + member.count;
      merged.count += member.count;
    }
    range.first.push_back(merged.count);
    ranges.push_back(std::move(range));
  }
  merged.live = merged.count;
  if (absl::Status status = TakeItems(merged); !status.ok()) return status;
  for (const Range& range : ranges) {
    if (range.from.empty()) continue;
    const absl::StatusOr<UploadedList> rows = UploadList(device_, range.from, range.first);
    if (!rows.ok()) return rows.status();
    absl::Status status = Copy(rows->list, range.first.front(), static_cast<uint32_t>(rows->items),
                               *range.batch, merged);
    if (!status.ok()) return status;
  }
  if (absl::Status status = Sort(merged, nullptr); !status.ok()) return status;
  if (merged.deferred) {
    // There may be enough memory if their lists are dropped.
    bool dropped = false;
    for (const uint64_t old : numbers) {
      Batch& batch = batches_.at(old);
      if (batch.deferred) continue;
      if (absl::Status status = Defer(batch, nullptr); !status.ok()) return status;
      dropped = true;
    }
    if (dropped) {
      if (absl::Status status = Sort(merged, nullptr); !status.ok()) return status;
    }
  }
  const uint64_t number = next_number_++;
  for (size_t m = 0; m < merged.members.size(); ++m) {
    places_[merged.members[m].slot] = {number, m};
  }
  for (const uint64_t old : numbers) batches_.erase(old);
  batches_.emplace(number, std::move(merged));
  return absl::OkStatus();
}

absl::Status RegionIndex::Merge() {
  while (merge_) {
    std::vector<std::pair<uint32_t, uint64_t>> order;  // items, batch
    for (const auto& [number, batch] : batches_) order.push_back({batch.count, number});
    std::sort(order.begin(), order.end());
    std::vector<uint64_t> chosen;
    const bool crowded = order.size() > kMaxRegionBatches;
    for (size_t i = 0; i < order.size() && chosen.empty(); ++i) {
      const Batch& batch = batches_.at(order[i].second);
      if (batch.live < batch.count / 2) chosen = {order[i].second};
      for (size_t j = i + 1; j < order.size() && chosen.empty(); ++j) {
        const Batch& other = batches_.at(order[j].second);
        if (other.layer != batch.layer) continue;
        if (uint64_t{other.count} + batch.count > most_items_) continue;
        // Otherwise a batch that has lists might lose them.
        if (other.deferred != batch.deferred && !crowded) continue;
        if (crowded || other.count / 2 <= batch.count) {
          chosen = {order[i].second, order[j].second};
        }
      }
    }
    merge_ = !chosen.empty();
    if (!merge_) break;
    const absl::Status status = MergeFrom(chosen);
    if (absl::IsResourceExhausted(status) && order.size() <= kMaxRegionBatches) {
      merge_ = false;  // until something changes
      break;
    }
    if (!status.ok()) return status;
  }
  if (batches_.size() > kMaxRegionBatches) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the scene has too many ", what_, " to be drawn at once"));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::gpu::cuda
