#include "gpu/assemble/volume.h"

#include <algorithm>
#include <atomic>
#include <new>
#include <utility>

#include "absl/container/flat_hash_set.h"
#include "gpu/assemble/blend.h"
#include "gpu/assemble/draw.h"
#include "gpu/assemble/tile_clip.h"
#include "gpu/derived_bytes.h"

namespace voxeld::gpu {
namespace {

// Without its entries in tiles, which entries_bytes_ counts.
uint64_t DerivedBytes(const Drawable& d) {
  return VectorBytes(d.vertices) + VectorBytes(d.hoisted) + VectorBytes(d.inside) +
         (d.cut != nullptr ? d.cut->bytes() : 0) + VectorBytes(d.bins.tiles) +
         VectorBytes(d.bins.begin) + VectorBytes(d.bins.counts) + VectorBytes(d.bins.triangles) +
         d.bins.item_bytes();
}

constexpr size_t kSmallDrawable = 2048;  // vertices: prepared by one thread
constexpr size_t kCachedTiles = 1024;    // drawn in one frame: so many colours may stay in caches
constexpr size_t kFreeBlocks = 256;      // kept, beside as many as are spare
constexpr size_t kKeptEntries = 4096;    // of a list of drawables whose entries have gone
constexpr size_t kKeptInTile = 64;       // the same, of the list of a tile
// From so many entries below a layer on, their blended colours are kept while that layer changes. The entries themselves
// take as much memory.
constexpr size_t kManyBelow = kTileVoxels / 4;
constexpr size_t kMovedRun = 16;  // tiles that a worker draws one behind the other where more are

// Releases the unused capacity of a list that has become much shorter.
template <typename T>
void GiveBack(std::vector<T>& list, size_t kept) {
  if (list.capacity() > kept && list.size() < list.capacity() / 8) list.shrink_to_fit();
}

bool Contains(const Box3& box, const int32_t at[3]) {
  for (int a = 0; a < 3; ++a) {
    if (at[a] < box.lo[a] || at[a] >= box.hi[a]) return false;
  }
  return true;
}

// Puts a layer's words over the colours of a tile.
void BlendTile(const LayerRecord& layer, const uint32_t* words, uint32_t* colors) {
  if (layer.blend == BlendMode::kOver && layer.opacity == 255) {
    // The commonest case, without branches.
    for (size_t v = 0; v < kTileVoxels; ++v) {
      const uint32_t word = words[v];
      const uint32_t covered = (word & kEraseBit) != 0 || word == 0 ? 0 : ~uint32_t{0};
      colors[v] = (word & kColorMask & covered) | (colors[v] & ~covered);
    }
    return;
  }
  for (size_t v = 0; v < kTileVoxels; ++v) {
    if (words[v] != 0) colors[v] = BlendLayer(colors[v], words[v], layer.blend, layer.opacity);
  }
}

// Uncovers what the mask does not cover, and leaves that zeros.
void TakeMask(uint32_t* mask, uint32_t* words) {
  for (size_t v = 0; v < kTileVoxels; ++v) {
    if (!IsCovered(mask[v])) words[v] = 0;
    mask[v] = 0;
  }
}

}  // namespace

void TileStore::Reset(const TileGrid& grid) {
  grid_ = grid;
  pool_.Reset(sizeof(Block), grid.count());
  blocks_.assign(grid.count(), nullptr);
  lit_.assign(grid.count(), 0);
  spare_.clear();
  spare_left_ = 0;
}

bool TileStore::Set(uint32_t tile, const uint32_t* colors, uint32_t lit) {
  TileWords copy;
  std::copy_n(colors, kTileVoxels, copy.at);
  TileRows rows;
  LitColors(copy.at, rows);
  Expect({&tile, 1});
  const bool differs = Take(tile, copy, rows, lit, false);
  Recycle({&tile, 1}, spare_.size());
  return differs;
}

TileStore::Block* TileStore::TakeBlock() {
  const std::atomic_ref<size_t> spares(spare_left_);
  size_t left = spares.load(std::memory_order_relaxed);
  while (left > 0) {
    if (spares.compare_exchange_weak(left, left - 1, std::memory_order_relaxed)) {
      return spare_[left - 1];
    }
  }
  return new (pool_.Take()) Block();
}

bool TileStore::Take(uint32_t tile, TileWords& colors, const TileRows& rows, uint32_t lit,
                     bool past_caches) {
  Block*& block = blocks_[tile];
  const uint32_t before = std::exchange(lit_[tile], lit);
  if (lit == 0) return before != 0;  // what it held stays, for Recycle
  if (block == nullptr) block = TakeBlock();
  const bool differs = MoveColors(colors.at, rows, past_caches, block->colors.at, block->rows);
  block->rows = rows;
  return differs || before == 0;
}

bool TileStore::TakeWords(uint32_t tile, TileWords& words, const TileRows& touched,
                          bool past_caches) {
  Block*& block = blocks_[tile];
  if (block == nullptr) block = TakeBlock();
  const MovedWords moved = MoveWords(words.at, touched, past_caches, block->colors.at, block->rows);
  const uint32_t before = std::exchange(lit_[tile], moved.lit);
  return moved.lit == 0 ? before != 0 : moved.differ || before == 0;
}

void TileStore::Expect(std::span<const uint32_t> tiles) {
  size_t none = 0;
  for (uint32_t tile : tiles) none += blocks_[tile] == nullptr;
  pool_.Provide(none - std::min(none, spare_.size()));
}

void TileStore::Recycle(std::span<const uint32_t> tiles, size_t most) {
  pool_.Settle();
  spare_.resize(spare_left_);
  for (uint32_t tile : tiles) {
    if (lit_[tile] == 0 && blocks_[tile] != nullptr) {
      spare_.push_back(std::exchange(blocks_[tile], nullptr));
    }
  }
  while (spare_.size() > most) {
    pool_.Give(spare_.back());
    spare_.pop_back();
  }
  spare_left_ = spare_.size();
  pool_.Trim(most + kFreeBlocks);
}

uint64_t Volume::index_bytes() const {
  uint64_t bytes = budget_.kept_bytes() + large_.bytes() + passes_.bytes();
  for (const Scratch& scratch : scratch_) bytes += scratch.bins.bytes();
  return bytes;
}

uint64_t Volume::memory_bytes() const {
  return scene_.memory_bytes() + derived_bytes_ + entries_bytes_ + index_bytes() -
         budget_.kept_bytes() + tiles_.memory_bytes() + tiles_below_ * HeapBytes(sizeof(Below));
}

void Volume::MarkDirty(uint32_t tile, const LayerKey& layer) {
  TileIndex& index = index_[tile];
  if (index.dirty) {
    index.lowest = std::min(index.lowest, layer);
    return;
  }
  index.dirty = true;
  index.lowest = layer;
  dirty_.push_back(tile);
}

template <typename Fn>
void Volume::ForEachTile(const Drawable& d, Fn fn) const {
  if (!d.unlisted) {
    for (const uint32_t tile : d.bins.tiles) fn(tile);
    return;
  }
  const Box3& box = d.tile_box;
  for (int32_t k = box.lo[2]; k < box.hi[2]; ++k) {
    for (int32_t j = box.lo[1]; j < box.hi[1]; ++j) {
      for (int32_t i = box.lo[0]; i < box.hi[0]; ++i) {
        const uint32_t tile = grid_.Index(i, j, k);
        if (owned_[tile] != 0) fn(tile);
      }
    }
  }
}

void Volume::OnLeave(Drawable& drawable) {
  executor_.ThrowIfAbandoned();
  if (drawable.pending || drawable.leaving) return;  // in no tile, or on its way out already
  const LayerKey layer = KeyOf(drawable.layer->record);
  if (drawable.unlisted && drawable.layer->drawn) {
    ForEachTile(drawable, [&](uint32_t tile) { MarkDirty(tile, layer); });
  }
  for (uint32_t tile : drawable.bins.tiles) {
    if (drawable.layer->drawn) MarkDirty(tile, layer);
    if (!index_[tile].leaving) {
      index_[tile].leaving = true;
      leaving_.push_back(tile);
    }
  }
  singular_ -= IsSingular(drawable);
  counted_ -= drawable.bins.counted();
  derived_bytes_ -= drawable.derived_bytes;
  drawable.leaving = true;
  left_.push_back(&drawable);
}

void Volume::OnEnter(Drawable& drawable) {
  executor_.ThrowIfAbandoned();
  if (drawable.pending) return;
  drawable.pending = true;
  pending_.push_back(&drawable);
}

void Volume::OnLayerLook(Layer& layer, const LayerRecord& next) {
  const LayerRecord& now = layer.record;
  if (LooksSame(now, next) || (!layer.drawn && next.visible == 0)) return;
  // Nothing of it was to be seen, and where it will be is not known yet.
  if (!layer.drawn && !(now.transform == next.transform)) return;
  const LayerKey lower = std::min(KeyOf(now), KeyOf(next));
  for (Drawable* drawable : layer.drawables) {
    ForEachTile(*drawable, [&](uint32_t tile) { MarkDirty(tile, lower); });
  }
}

// At a cost that drawing those tiles exceeds.
void Volume::TakeOutLeaving() {
  for (uint32_t tile : leaving_) {
    std::vector<Entry>& entries = index_[tile].entries;
    std::erase_if(entries, [](const Entry& e) { return e.drawable->leaving; });
    entries_bytes_ -= VectorBytes(entries);
    GiveBack(entries, kKeptInTile);
    entries_bytes_ += VectorBytes(entries);
    index_[tile].leaving = false;
  }
  leaving_.clear();
  std::erase_if(unlisted_, [](const Drawable* d) { return d->leaving; });
  for (Drawable* drawable : left_) {
    drawable->leaving = drawable->unlisted = false;
    drawable->bins.Clear();
    budget_.ReleaseLists(*drawable);
  }
  left_.clear();
  GiveBack(left_, kKeptEntries);
}

absl::Status Volume::Apply(std::span<const std::byte> delta, BulkSource* bulk) {
  std::vector<std::unique_ptr<Drawable>> gone;
  absl::Status status = scene_.Apply(delta, bulk, *this, gone);
  TakeOutLeaving();
  scene_.MapClips(view_, false);
  masked_ = std::ranges::any_of(
      scene_.layers(), [](const auto& layer) { return layer.second->record.has_mask != 0; });
  for (const std::unique_ptr<Drawable>& drawable : gone) budget_.Release(*drawable);
  if (!gone.empty()) {
    std::erase_if(pending_, [](const Drawable* d) { return d->layer == nullptr; });
  }
  return status;
}

void Volume::SetView(const TileGrid& grid, const Affine& view, std::vector<uint8_t> owned) {
  grid_ = grid;
  view_ = view;
  scene_.MapClips(view_, true);
  owned_ = std::move(owned);
  index_.clear();
  index_.resize(grid.count());
  dirty_.clear();
  pending_.clear();
  tiles_.Reset(grid);
  lit_voxels_ = 0;
  lit_tiles_ = 0;
  derived_bytes_ = 0;
  entries_bytes_ = 0;
  tiles_below_ = 0;
  singular_ = 0;
  counted_ = 0;
  most_kept_ = 0;
  unlisted_.clear();
  for (const auto& [id, drawable] : scene_.drawables()) {
    drawable->pending = true;
    drawable->unlisted = false;
    drawable->bins.Clear();
    budget_.ReleaseLists(*drawable);
    pending_.push_back(drawable.get());
  }
  scratch_.resize(static_cast<size_t>(executor_.concurrency()));
  for (Scratch& scratch : scratch_) {
    if (scratch.words != nullptr) continue;
    scratch.words = std::make_unique<TileWords>();
    scratch.colors = std::make_unique<TileWords>();
    scratch.mask = std::make_unique<TileWords>();
    for (TileWords* words : {scratch.words.get(), scratch.colors.get(), scratch.mask.get()}) {
      std::fill_n(words->at, kTileVoxels, 0);
    }
  }
}

bool Volume::Keep(Drawable& d, Executor& executor, uint64_t bytes, BinScratch& scratch) {
  if (!FindBins(d, grid_, owned_, executor, {.bytes = bytes}, scratch, d.bins)) {
    budget_.Release(d);
    return false;
  }
  if (!budget_.Keep(d)) return false;
  ListOrForget(d);
  return true;
}

void Volume::ListOrForget(Drawable& d) {
  if (budget_.TryChargeLists(d)) return;
  d.unlisted = true;
  d.tile_box = {};
  for (size_t r = 0; r < d.bins.tiles.size(); ++r) {
    int32_t at[3];
    grid_.Coordinates(d.bins.tiles[r], at);
    for (int a = 0; a < 3; ++a) {
      d.tile_box.lo[a] = r == 0 ? at[a] : std::min(d.tile_box.lo[a], at[a]);
      d.tile_box.hi[a] = r == 0 ? at[a] + 1 : std::max(d.tile_box.hi[a], at[a] + 1);
    }
  }
  Forget(d);
}

void Volume::Forget(Drawable& d) {
  budget_.Release(d);
  if (d.cut == nullptr) return;
  d.source = {};
  d.source.record = &d.geometry->view.record;
  d.cut = nullptr;
}

void Volume::Prepare(std::span<Drawable* const> small, std::span<Drawable* const> large) {
  const std::unique_ptr<Executor> serial = MakeSerialExecutor();
  const uint64_t bytes = budget_.room_of_worker(executor_.concurrency());
  std::vector<uint8_t> kept(small.size());
  executor_.For(small.size(), 4, [&](size_t i, int worker) {
    MapDrawable(*small[i], view_, grid_, *serial, bytes);
    kept[i] = Keep(*small[i], *serial, bytes, scratch_[static_cast<size_t>(worker)].bins);
  });
  const auto keep_or_count = [&](Drawable& d) {
    if (Keep(d, executor_, budget_.room(), large_)) return;
    CountItems(d.source, grid_, owned_, executor_, budget_.room(), large_, d.bins);
    ListOrForget(d);
  };
  for (size_t i = 0; i < small.size(); ++i) {
    if (small[i]->unlisted) continue;
    // There may be room now for what was too much for one of the workers.
    const bool filled = FillIn(*small[i], budget_.room() / 2, executor_);
    if (kept[i] == 0 || filled) keep_or_count(*small[i]);
  }
  for (Drawable* d : large) {
    MapDrawable(*d, view_, grid_, executor_, budget_.room() / 2);
    keep_or_count(*d);
  }
  if (large_.bytes() > budget_.room_to_keep()) large_ = BinScratch();
}

void Volume::PreparePending() {
  std::vector<Drawable*> small, large;
  for (Drawable* d : pending_) {
    const GeometryRecord& g = d->geometry->view.record;
    (std::max(g.vertex_count, g.index_count) <= kSmallDrawable ? small : large).push_back(d);
  }
  Prepare(small, large);
  for (Drawable* d : pending_) {
    d->pending = false;
    singular_ += IsSingular(*d);
    counted_ += d->bins.counted();
    d->derived_bytes = DerivedBytes(*d);
    derived_bytes_ += d->derived_bytes;
    List(*d);
    if (!d->layer->drawn) continue;
    ForEachTile(*d, [&](uint32_t tile) { MarkDirty(tile, KeyOf(d->layer->record)); });
  }
  pending_.clear();
  GiveBack(pending_, kKeptEntries);
}

void Volume::List(Drawable& d) {
  if (d.unlisted) {
    unlisted_.push_back(&d);
    return;
  }
  for (uint32_t row = 0; row < d.bins.tiles.size(); ++row) {
    std::vector<Entry>& entries = index_[d.bins.tiles[row]].entries;
    if (entries.size() < entries.capacity()) {
      entries.push_back({&d, row});
      continue;
    }
    entries_bytes_ -= VectorBytes(entries);
    entries.push_back({&d, row});
    entries_bytes_ += VectorBytes(entries);
  }
}

void Volume::RetryUnlisted() {
  if (unlisted_.empty() || !budget_.RefusedWouldFit()) return;
  for (Drawable* d : unlisted_) {
    singular_ -= IsSingular(*d);
    derived_bytes_ -= d->derived_bytes;
    d->unlisted = false;
    d->pending = true;
    pending_.push_back(d);
  }
  unlisted_.clear();
  PreparePending();
}

void Volume::KeepCounted() {
  if (counted_ == 0 || budget_.kept_bytes() + budget_.room_to_keep() > most_kept_) return;
  most_kept_ = 0;
  for (const auto& [id, drawable] : scene_.drawables()) {
    Drawable& d = *drawable;
    if (!d.bins.counted()) continue;
    Bins counted = std::move(d.bins);
    d.bins = Bins();
    FillIn(d, budget_.room() / 2, executor_);
    if (!Keep(d, executor_, budget_.room(), large_)) {
      d.bins = std::move(counted);
      continue;  // a smaller one may fit
    }
    for (const uint32_t tile : counted.tiles) {
      std::erase_if(index_[tile].entries, [&](const Entry& e) { return e.drawable == &d; });
    }
    List(d);
    derived_bytes_ -= d.derived_bytes;
    d.derived_bytes = DerivedBytes(d);
    derived_bytes_ += d.derived_bytes;
    if (--counted_ == 0) break;
  }
  if (large_.bytes() > budget_.room_to_keep()) large_ = BinScratch();
}

std::span<const Volume::Entry> Volume::EntriesOf(const Layer& layer,
                                                 std::span<const Entry> entries) {
  const auto rank = [](const Entry& e) { return e.drawable->layer->rank; };
  const auto [begin, end] = std::ranges::equal_range(entries, layer.rank, {}, rank);
  return {begin, end};
}

void Volume::DrawEntries(std::span<const Entry> entries, uint32_t tile, const Box3& box,
                         uint32_t* words, TileRows& touched) {
  for (const Entry& e : entries) {
    const Bins& bins = e.drawable->bins;
    if (e.drawable->unlisted) {
      DrawUnlisted(*e.drawable, tile, box, words, touched);
    } else if (bins.counted()) {
      passes_.Draw(*e.drawable, tile, box, words, touched);
    } else {
      DrawItems(*e.drawable, bins, bins.row(e.row), grid_, box, words, touched);
    }
  }
}

bool Volume::DrawMask(const Layer& layer, uint32_t tile, const Box3& box, Scratch& scratch) {
  const std::span<const Entry> entries = EntriesOf(layer, scratch.entries);
  const TileClip clip(*layer.clip, box);
  if (entries.empty() || clip.outside()) return false;
  uint32_t* const words = scratch.mask->at;
  TileRows touched;
  DrawEntries(entries, tile, box, words, touched);
  clip.Uncover(grid_, box, words);
  return true;
}

// False if it comes out as it was. `next`: the tile that this worker draws after it, if it is known.
bool Volume::DrawTile(uint32_t tile, const uint32_t* next, bool past_caches, TileObserver* observer,
                      Scratch& scratch) {
  scratch.entries.clear();
  TileIndex& index = index_[tile];
  const bool keeps = !masked_ && scratch.unlisted.empty();
  // What is kept is right if only layers from its place on have changed.
  if (index.below != nullptr && (!keeps || index.lowest < index.below->key)) index.below = nullptr;
  for (const Entry& e : index.entries) {
    const Layer& layer = *e.drawable->layer;
    if (!layer.drawn) continue;
    if (index.below != nullptr && KeyOf(layer.record) < index.below->key) continue;
    scratch.entries.push_back(e);
  }
  scratch.entries.insert(scratch.entries.end(), scratch.unlisted.begin(), scratch.unlisted.end());
  const std::span<const Entry> entries = scratch.entries;
  if (!std::is_sorted(entries.begin(), entries.end(), Lower)) {
    std::sort(scratch.entries.begin(), scratch.entries.end(), Lower);
  }
  const Box3 box = grid_.VoxelsOf(tile);
  uint32_t* const words = scratch.words->at;
  TileWords* colors =
      scratch.words
          .get();  // of the layers so far; while there are none, the next one's words become them
  if (index.below != nullptr) {
    colors = scratch.colors.get();
    *colors = index.below->colors;
  }
  uint32_t lit = 0;
  TileRows rows;
  TileRows touched;
  bool above = false;  // the layers drawn from here on are at or above the lowest that changed
  // While this one is moved.
  const auto fetch_next = [&] {
    if (next == nullptr) return;
    for (const Entry& e : index_[*next].entries) {
      if (e.drawable->bins.counted()) continue;
      FetchItems(*e.drawable, e.drawable->bins.row(e.row));
    }
  };
  for (size_t i = 0; i < entries.size();) {
    const Layer& layer = *entries[i].drawable->layer;
    if (!above && KeyOf(layer.record) >= index.lowest) {
      above = true;
      if (keeps && i >= kManyBelow) {
        if (index.below == nullptr) index.below = std::make_unique<Below>();
        index.below->key = index.lowest;
        index.below->colors = *colors;
      }
    }
    const std::span<const Entry> of_layer = EntriesOf(layer, entries.subspan(i));
    i += of_layer.size();
    const TileClip clip(*layer.clip, box);
    if (!layer.seen() || clip.outside()) continue;
    if (layer.mask != nullptr && !DrawMask(*layer.mask, tile, box, scratch)) continue;
    DrawEntries(of_layer, tile, box, words, touched);
    clip.Uncover(grid_, box, words);
    if (layer.mask != nullptr) TakeMask(scratch.mask->at, words);
    const bool opaque = layer.record.blend == BlendMode::kOver && layer.record.opacity == 255;
    if (opaque && i == entries.size() && colors->at == words) {
      if (observer == nullptr) {
        fetch_next();
        return tiles_.TakeWords(tile, *scratch.words, touched, past_caches);
      }
      lit = ShowWords(words, touched, rows);
      break;
    }
    colors = scratch.colors.get();
    BlendTile(layer.record, words, colors->at);
    std::fill_n(words, kTileVoxels, 0);
  }
  if (colors->at != words) lit = LitColors(colors->at, rows);
  if (observer != nullptr) observer->OnTile(tile, colors->at, rows);
  fetch_next();
  return tiles_.Take(tile, *colors, rows, lit, past_caches);
}

void Volume::DrawRun(TileRun run, TileObserver* observer, std::span<Drawn> drawn) {
  const bool past_caches = dirty_.size() > kCachedTiles;
  const size_t count = run.end - run.begin;
  // Waiting for moves takes as long as drawing some tiles, so it is not done after each.
  const size_t at_once = past_caches ? kMovedRun : 1;
  executor_.For((count + at_once - 1) / at_once, 1, [&](size_t r, int worker) {
    const size_t begin = run.begin + r * at_once, end = std::min(run.end, begin + at_once);
    for (size_t i = begin; i < end; ++i) {
      const uint32_t tile = dirty_[i];
      if (i + 2 < run.end) __builtin_prefetch(index_[dirty_[i + 2]].entries.data());
      // Others draw what lies beyond the run.
      const uint32_t* const next = i + 1 < end ? &dirty_[i + 1] : nullptr;
      if (next != nullptr) tiles_.Prefetch(*next);
      drawn[i].lit_before = tiles_.lit(tile);
      drawn[i].differs =
          DrawTile(tile, next, past_caches, observer, scratch_[static_cast<size_t>(worker)]);
    }
    if (past_caches) FinishMoves();
  });
}

bool Volume::SeenCounted(const Entry& e) const {
  return e.drawable->bins.counted() && e.drawable->layer->drawn;
}

// With the items of its counted drawables; what these do not fit into is cut in halves, down to a tile.
void Volume::DrawPass(TileRun run, TileObserver* observer, std::span<Drawn> drawn) {
  const std::span<const uint32_t> tiles = std::span(dirty_).subspan(run.begin, run.end - run.begin);
  absl::flat_hash_set<const Drawable*> seen;
  for (uint32_t tile : tiles) {
    for (const Entry& e : index_[tile].entries) {
      if (SeenCounted(e)) seen.insert(e.drawable);
    }
  }
  const std::vector<const Drawable*> drawables(seen.begin(), seen.end());
  if (passes_.Fill(drawables, tiles, grid_, budget_.room())) {
    return DrawRun(run, observer, drawn);
  }
  if (tiles.size() == 1) return DrawAlone(run.begin, observer, drawn);
  const size_t middle = run.begin + tiles.size() / 2;
  DrawPass({run.begin, middle}, observer, drawn);
  DrawPass({middle, run.end}, observer, drawn);
}

bool Volume::HasUnlisted(uint32_t tile) const {
  int32_t at[3];
  grid_.Coordinates(tile, at);
  return std::ranges::any_of(
      unlisted_, [&at](const Drawable* d) { return d->layer->drawn && Contains(d->tile_box, at); });
}

void Volume::DrawAlone(size_t i, TileObserver* observer, std::span<Drawn> drawn) {
  const uint32_t tile = dirty_[i];
  passes_.FillByRanges(tile, grid_, budget_.room());
  Scratch& scratch = scratch_[0];
  int32_t at[3];
  grid_.Coordinates(tile, at);
  for (Drawable* d : unlisted_) {
    if (d->layer->drawn && Contains(d->tile_box, at)) scratch.unlisted.push_back({d, 0});
  }
  const bool past_caches = dirty_.size() > kCachedTiles;
  drawn[i].lit_before = tiles_.lit(tile);
  drawn[i].differs = DrawTile(tile, nullptr, past_caches, observer, scratch);
  if (past_caches) FinishMoves();
  scratch.unlisted.clear();
}

void Volume::DrawUnlisted(Drawable& d, uint32_t tile, const Box3& box, uint32_t* words,
                          TileRows& touched) {
  executor_.ThrowIfAbandoned();
  const bool curved = IsCurved(d.geometry->view.record.kind);
  if (curved) MapDrawable(d, view_, grid_, executor_);
  passes_.Draw(d, tile, box, words, touched);
  if (curved) Forget(d);
}

void Volume::DrawInPasses(TileObserver* observer, std::span<Drawn> drawn) {
  std::vector<uint64_t> items(dirty_.size());
  for (size_t i = 0; i < dirty_.size(); ++i) {
    for (const Entry& e : index_[dirty_[i]].entries) {
      if (SeenCounted(e)) items[i] += e.drawable->bins.counts[e.row];
    }
  }
  large_ = BinScratch();  // the passes have its room
  size_t begin = 0;
  for (size_t i = 0; i <= dirty_.size(); ++i) {
    const bool alone = i < dirty_.size() && HasUnlisted(dirty_[i]);
    if (i < dirty_.size() && !alone) continue;
    const std::span<const uint64_t> between = std::span(items).subspan(begin, i - begin);
    for (const TileRun run : PlanPasses(between, budget_.room())) {
      DrawPass({begin + run.begin, begin + run.end}, observer, drawn);
    }
    if (alone) DrawAlone(i, observer, drawn);
    begin = i + 1;
  }
  passes_.Release();
}

Volume::Changes Volume::Update(TileObserver* observer) {
  PreparePending();
  RetryUnlisted();
  KeepCounted();
  most_kept_ = std::max(most_kept_, budget_.kept_bytes());
  std::sort(dirty_.begin(), dirty_.end());
  Changes changes;
  changes.tiles_drawn = static_cast<uint32_t>(dirty_.size());
  std::vector<Drawn> drawn(dirty_.size());
  for (const uint32_t tile : dirty_) tiles_below_ -= index_[tile].below != nullptr;
  tiles_.Expect(dirty_);
  if (counted_ == 0 && unlisted_.empty()) {
    DrawRun({0, dirty_.size()}, observer, drawn);
  } else {
    DrawInPasses(observer, drawn);
  }
  for (size_t i = 0; i < dirty_.size(); ++i) {
    const uint32_t tile = dirty_[i];
    index_[tile].dirty = false;
    tiles_below_ += index_[tile].below != nullptr;
    if (owned_[tile] == kOwned) lit_voxels_ = lit_voxels_ - drawn[i].lit_before + tiles_.lit(tile);
    lit_tiles_ = lit_tiles_ - (drawn[i].lit_before != 0) + (tiles_.lit(tile) != 0);
    if (!drawn[i].differs) continue;
    changes.tiles.push_back(tile);
    changes.was_lit.push_back(drawn[i].lit_before != 0);
  }
  for (Scratch& scratch : scratch_) {
    GiveBack(scratch.entries, kKeptEntries);
    GiveBack(scratch.unlisted, kKeptEntries);
  }
  tiles_.Recycle(dirty_, static_cast<size_t>(lit_tiles_ / 2));
  dirty_.clear();
  return changes;
}

}  // namespace voxeld::gpu
