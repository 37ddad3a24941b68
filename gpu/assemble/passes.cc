#include "gpu/assemble/passes.h"

#include <algorithm>
#include <utility>

#include "gpu/assemble/draw.h"

namespace voxeld::gpu {
namespace {

// Of an item in a tile, all in all: what it is expected to need. More where lines are long, less where triangles are.
constexpr uint64_t kItemBytes = 192;
// Bytes of a drawable in the list of a tile: a Volume::Entry of 16, and half of that for unused capacity, on average.
constexpr uint64_t kEntryBytes = 24;

}  // namespace

void IndexBudget::Charge(Drawable& d, uint64_t bytes) {
  kept_.fetch_add(bytes - std::exchange(d.index_bytes, bytes), std::memory_order_relaxed);
}

bool IndexBudget::Keep(Drawable& d) {
  Charge(d, d.bins.item_bytes() + d.inside.capacity() * sizeof(d.inside[0]));
  if (kept_bytes() <= bytes_ / 4 * 3) return true;
  Release(d);
  return false;
}

void IndexBudget::Release(Drawable& d) {
  d.bins = Bins();
  d.inside = std::vector<uint32_t>();  // "= {}" would keep the memory
  d.source.inside = nullptr;
  Charge(d, 0);
}

bool IndexBudget::TryChargeLists(Drawable& d) {
  ReleaseLists(d);
  const Bins& bins = d.bins;
  // As much with counts as with items, so that a drawable that is counted has room when its items do.
  const uint64_t words =
      bins.tiles.capacity() +
      std::max({bins.begin.capacity(), bins.counts.capacity(), bins.tiles.size() + 1});
  const uint64_t bytes = words * sizeof(uint32_t) + bins.tiles.size() * kEntryBytes +
                         (d.cut != nullptr ? d.cut->bytes() : 0);
  // What does not fit is not charged for a moment either, so it keeps out no other drawable.
  uint64_t listed = listed_bytes();
  while (bytes <= list_bytes_ && listed <= list_bytes_ - bytes) {
    if (!listed_.compare_exchange_weak(listed, listed + bytes, std::memory_order_relaxed)) continue;
    d.list_bytes = bytes;
    return true;
  }
  uint64_t least = least_refused_.load(std::memory_order_relaxed);
  while (bytes < least &&
         !least_refused_.compare_exchange_weak(least, bytes, std::memory_order_relaxed)) {
  }
  return false;
}

void IndexBudget::ReleaseLists(Drawable& d) {
  listed_.fetch_sub(std::exchange(d.list_bytes, 0), std::memory_order_relaxed);
}

bool IndexBudget::RefusedWouldFit() {
  const uint64_t least = least_refused_.load(std::memory_order_relaxed);
  if (least > list_bytes_ || listed_bytes() > list_bytes_ - least) return false;
  least_refused_.store(UINT64_MAX, std::memory_order_relaxed);
  return true;
}

bool FindBins(const Drawable& d, const TileGrid& grid, std::span<const uint8_t> owned,
              Executor& executor, BinLimits limits, BinScratch& scratch, Bins& bins) {
  uint64_t held = scratch.bytes();
  if (held > limits.bytes / 4) {
    scratch = BinScratch();
    held = 0;
  }
  limits.bytes -= held;
  return BinItems(d.source, grid, owned, d.record.priority, d.record.erase != 0, executor, limits,
                  scratch, bins);
}

std::vector<TileRun> PlanPasses(std::span<const uint64_t> items, uint64_t bytes) {
  std::vector<TileRun> runs;
  const uint64_t most = bytes / kItemBytes;
  TileRun run;
  uint64_t sum = 0;
  for (size_t i = 0; i < items.size(); ++i) {
    if (run.end > run.begin && items[i] > 0 && sum + items[i] > most) {
      runs.push_back(run);
      run.begin = i;
      sum = 0;
    }
    sum += items[i];
    run.end = i + 1;
  }
  if (run.end > run.begin) runs.push_back(run);
  return runs;
}

void PassBins::Want(std::span<const uint32_t> tiles, const TileGrid& grid) {
  grid_ = grid;
  for (uint32_t tile : tiles_) {
    if (tile < wanted_.size()) wanted_[tile] = 0;
  }
  wanted_.resize(grid.count());
  tiles_.assign(tiles.begin(), tiles.end());
  for (size_t i = 0; i < tiles_.size(); ++i) {
    wanted_[tiles_[i]] = 1;
    const Box3 box = grid.VoxelsOf(tiles_[i]);
    for (int a = 0; a < 3; ++a) {
      box_.lo[a] = i == 0 ? box.lo[a] : std::min(box_.lo[a], box.lo[a]);
      box_.hi[a] = i == 0 ? box.hi[a] : std::max(box_.hi[a], box.hi[a]);
    }
  }
}

bool PassBins::FindIn(size_t slot, const Drawable& d, BinLimits limits) {
  if (slots_.size() <= slot) slots_.resize(slot + 1);
  Bins& bins = slots_[slot];
  limits.choose = true;
  limits.box = box_;
  held_ -= bins.item_bytes();
  const bool fits = FindBins(d, grid_, wanted_, executor_, limits, scratch_, bins);
  held_ += bins.item_bytes();
  most_ = std::max(most_, bytes());
  return fits;
}

bool PassBins::Fill(std::span<const Drawable* const> drawables, std::span<const uint32_t> tiles,
                    const TileGrid& grid, uint64_t bytes) {
  by_ranges_ = false;
  Want(tiles, grid);
  slot_of_.clear();
  if (held_ > bytes / 4) Release();
  for (const Drawable* d : drawables) {
    const size_t slot = slot_of_.size();
    if (held_ >= bytes || !FindIn(slot, *d, {.bytes = bytes - held_})) return false;
    slot_of_[d] = slot;
  }
  return true;
}

void PassBins::FillByRanges(uint32_t tile, const TileGrid& grid, uint64_t bytes) {
  Release();
  Want({&tile, 1}, grid);
  by_ranges_ = true;
  limit_ = bytes;
}

void PassBins::Draw(const Drawable& d, uint32_t tile, const Box3& box, uint32_t* words,
                    TileRows& touched) {
  if (by_ranges_) return DrawByRanges(d, box, words, touched);
  const Bins& bins = slots_[slot_of_.at(&d)];
  const auto at = std::lower_bound(bins.tiles.begin(), bins.tiles.end(), tile);
  if (at == bins.tiles.end() || *at != tile) return;
  const auto row = static_cast<size_t>(at - bins.tiles.begin());
  DrawItems(d, bins, bins.row(row), grid_, box, words, touched);
}

void PassBins::DrawByRanges(const Drawable& d, const Box3& box, uint32_t* words,
                            TileRows& touched) {
  const uint32_t count = ItemCount(d.source);
  uint64_t size = std::max(uint64_t{1}, limit_ / kItemBytes);
  for (uint32_t first = 0; first < count;) {
    const auto last = static_cast<uint32_t>(std::min<uint64_t>(count, first + size));
    // One item has few spans in one tile.
    if (held_ > limit_ / 4) Release();
    const uint64_t bytes = last - first == 1 ? UINT64_MAX : limit_ - held_;
    if (!FindIn(0, d, {.bytes = bytes, .first = first, .last = last})) {
      size = std::max(uint64_t{1}, (last - first) / uint64_t{2});
      continue;
    }
    const Bins& bins = slots_[0];
    if (!bins.tiles.empty()) DrawItems(d, bins, bins.row(0), grid_, box, words, touched);
    first = last;
    size *= 2;
  }
}

void PassBins::Release() {
  slots_.clear();
  scratch_ = BinScratch();
  held_ = 0;
}

}  // namespace voxeld::gpu
