// The voxel volume on the CPU: tiles, the index of what lies in each,
// and the drawing of those that changed.
#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "gpu/affine.h"
#include "gpu/assemble/block_pool.h"
#include "gpu/assemble/passes.h"
#include "gpu/assemble/scene.h"
#include "gpu/assemble/span_kernel.h"
#include "gpu/cpu/executor.h"
#include "gpu/engine.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

struct alignas(64) TileWords {
  uint32_t at[kTileVoxels];
};

// Blended colours, interleaved (word.h), of the tiles that have any:
// a tile without light costs nothing.
class TileStore {
 public:
  void Reset(const TileGrid& grid);
  const TileGrid& grid() const { return grid_; }
  // kTileVoxels colours (TileGrid::IndexInTile), or nothing if all are black.
  const uint32_t* colors(uint32_t tile) const {
    return lit_[tile] == 0 ? nullptr : blocks_[tile]->colors.at;
  }
  // Where they are not black; only of a tile with colours.
  const TileRows& rows(uint32_t tile) const { return blocks_[tile]->rows; }
  uint32_t lit(uint32_t tile) const { return lit_[tile]; }
  // Copies `colors` (of kTileVoxels), of which `lit` are not black. False if the tile is as it was.
  bool Set(uint32_t tile, const uint32_t* colors, uint32_t lit);
  // Before Takes: these are all that may be taken until Recycle.
  void Expect(std::span<const uint32_t> tiles);
  // Takes `colors`, of which `lit`, in `rows`, are not black, and leaves zeros. False if the tile is as it was.
  // `past_caches`: they will not be read before much else was. Different tiles may be given by different threads.
  bool Take(uint32_t tile, TileWords& colors, const TileRows& rows, uint32_t lit, bool past_caches);
  // The same of words of a layer (ShowWords) in the rows `touched`.
  bool TakeWords(uint32_t tile, TileWords& words, const TileRows& touched, bool past_caches);
  // It will be taken soon.
  void Prefetch(uint32_t tile) const {
    const Block* const block = blocks_[tile];
    if (block == nullptr) return;
    __builtin_prefetch(&block->rows, /*rw=*/1);
    __builtin_prefetch(block->colors.at, /*rw=*/1);
  }
  // Between Takes: what tiles of these that went dark had is kept for others, `most` blocks at most in all.
  void Recycle(std::span<const uint32_t> tiles, size_t most);
  uint64_t memory_bytes() const { return pool_.memory_bytes(); }

 private:
  struct Block {
    TileWords colors;
    TileRows rows;  // where not black
  };
  Block* TakeBlock();

  TileGrid grid_;
  BlockPool pool_;
  std::vector<Block*> blocks_;
  std::vector<uint32_t> lit_;
  std::vector<Block*> spare_;  // the first spare_left_ of them, while tiles are taken
  size_t spare_left_ = 0;      // reached by atomic_ref then
};

// Is told of tiles as they are drawn, while their colours are in the nearest caches.
class TileObserver {
 public:
  virtual ~TileObserver() = default;
  // `colors`: kTileVoxels (TileGrid::IndexInTile), not black in `rows` alone. For different tiles by several threads.
  virtual void OnTile(uint32_t tile, const uint32_t* colors, const TileRows& rows) = 0;
};

// Thread-bound; the work inside is spread over `executor`.
class Volume final : private SceneObserver {
 public:
  // `index_bytes`: as EngineOptions has them. `list_bytes`: as IndexBudget has them.
  explicit Volume(Executor& executor, uint64_t index_bytes = 0, uint64_t list_bytes = 0)
      : executor_(executor), budget_(index_bytes, list_bytes), passes_(executor) {}

  // All or nothing; InvalidArgument for a malformed delta.
  absl::Status Apply(std::span<const std::byte> delta, BulkSource* bulk);

  // Everything is to be drawn anew, in the tiles with owned[tile] != 0.
  // `view`: scene → voxel space.
  void SetView(const TileGrid& grid, const Affine& view, std::vector<uint8_t> owned);

  struct Changes {
    uint32_t tiles_drawn = 0;
    std::vector<uint32_t> tiles;   // whose colours differ from before
    std::vector<uint8_t> was_lit;  // for each of them
  };
  // Draws what is dirty. `observer` may be null; it is told of every tile drawn, also if that comes out as it was.
  Changes Update(TileObserver* observer);

  const TileStore& tiles() const { return tiles_; }
  uint64_t lit_voxels() const { return lit_voxels_; }
  // What is derived from the scene, the memory for that, and the tiles with light.
  uint64_t memory_bytes() const;
  // Of the index: what is kept of items, and the memory for finding them.
  uint64_t index_bytes() const;
  // That are drawn in passes.
  size_t counted_drawables() const { return counted_; }
  // The number of drawables whose tile lists exceed the budget.
  size_t unlisted_drawables() const { return unlisted_.size(); }
  // Charged for lists of tiles and pieces of curves.
  uint64_t listed_bytes() const { return budget_.listed_bytes(); }
  // Solids whose map has no inverse: they draw nothing.
  uint32_t singular_drawables() const { return singular_; }

 private:
  struct Entry {
    Drawable* drawable;
    uint32_t row;  // of its bins
  };
  static bool Lower(const Entry& a, const Entry& b) {
    return a.drawable->layer->rank < b.drawable->layer->rank;
  }
  // The place of a layer in the order of combination.
  struct LayerKey {
    int32_t order = 0;
    uint64_t id = 0;
    auto operator<=>(const LayerKey&) const = default;
  };
  static LayerKey KeyOf(const LayerRecord& layer) { return {layer.order, layer.id}; }
  // The blended colours of all layers below a place, kept for a tile with many entries in them.
  struct Below {
    LayerKey key;
    TileWords colors;
  };
  // Of entries that are sorted, those of a layer.
  static std::span<const Entry> EntriesOf(const Layer& layer, std::span<const Entry> entries);
  struct TileIndex {
    std::vector<Entry> entries;
    bool dirty = false;
    bool leaving = false;  // some of its entries' drawables are
    LayerKey lowest;       // of the layers that make it dirty
    std::unique_ptr<Below> below;
  };
  // A worker's.
  struct Scratch {
    std::unique_ptr<TileWords> words, colors, mask;  // zeros between tiles
    std::vector<Entry> entries;
    std::vector<Entry> unlisted;  // of the tile that is drawn by itself
    BinScratch bins;
  };

  void OnLeave(Drawable& drawable) override;
  void OnEnter(Drawable& drawable) override;
  void OnLayerLook(Layer& layer, const LayerRecord& next) override;

  // `layer`: what changes, in this tile, is in it or in layers above it.
  void MarkDirty(uint32_t tile, const LayerKey& layer);
  void TakeOutLeaving();
  bool SeenCounted(const Entry& entry) const;
  // False if its bins are more than `bytes`, or than may be kept.
  bool Keep(Drawable& drawable, Executor& executor, uint64_t bytes, BinScratch& scratch);
  void Prepare(std::span<Drawable* const> small, std::span<Drawable* const> large);
  void PreparePending();
  // Calls fn(tile) for each tile in which the drawable may be.
  template <typename Fn>
  void ForEachTile(const Drawable& drawable, Fn fn) const;
  // Charges the lists of a drawable's tiles. If there is no room it becomes unlisted.
  void ListOrForget(Drawable& drawable);
  // Drops what ListOrForget could not keep.
  void Forget(Drawable& drawable);
  // Enters a drawable in the lists of its tiles, or among the unlisted ones.
  void List(Drawable& drawable);
  // Prepares unlisted drawables again, if one of them would fit now.
  void RetryUnlisted();
  // Keeps the bins of drawables that were only counted, if so much of the budget has become free that
  // it is worth trying.
  void KeepCounted();
  // Raises `words` to what entries of the tile, of one layer, cover.
  void DrawEntries(std::span<const Entry> entries, uint32_t tile, const Box3& box, uint32_t* words,
                   TileRows& touched);
  // The words of a layer among the entries of `scratch`, into its `mask`. False if it has none here.
  bool DrawMask(const Layer& layer, uint32_t tile, const Box3& box, Scratch& scratch);
  bool DrawTile(uint32_t tile, const uint32_t* next, bool past_caches, TileObserver* observer,
                Scratch& scratch);
  // What came of dirty_[i].
  struct Drawn {
    uint32_t lit_before = 0;
    bool differs = false;
  };
  void DrawRun(TileRun run, TileObserver* observer, std::span<Drawn> drawn);
  void DrawInPasses(TileObserver* observer, std::span<Drawn> drawn);
  void DrawPass(TileRun run, TileObserver* observer, std::span<Drawn> drawn);
  // Whether an unlisted drawable that is to be seen may be in the tile.
  bool HasUnlisted(uint32_t tile) const;
  // Draws dirty_[i] by itself, with what does not fit into passes or is not listed.
  void DrawAlone(size_t i, TileObserver* observer, std::span<Drawn> drawn);
  // Draws an unlisted drawable into `words`, while DrawAlone draws its tile.
  void DrawUnlisted(Drawable& drawable, uint32_t tile, const Box3& box, uint32_t* words,
                    TileRows& touched);

  Executor& executor_;
  Scene scene_;
  TileGrid grid_;
  Affine view_;
  std::vector<uint8_t> owned_;
  std::vector<TileIndex> index_;
  std::vector<uint32_t> dirty_;    // tiles
  std::vector<uint32_t> leaving_;  // tiles with leaving entries
  std::vector<Drawable*> pending_, left_, unlisted_;
  TileStore tiles_;
  std::vector<Scratch> scratch_;
  BinScratch large_;  // of drawables that all workers prepare
  IndexBudget budget_;
  PassBins passes_;
  size_t counted_ = 0;      // drawables
  uint64_t most_kept_ = 0;  // of the budget, since KeepCounted last tried
  uint64_t lit_voxels_ = 0, lit_tiles_ = 0, derived_bytes_ = 0;
  uint64_t entries_bytes_ = 0;  // of all index_[…].entries
  uint64_t tiles_below_ = 0;    // with index_[…].below
  bool masked_ = false;         // some layer has a mask, so a layer may depend on one above it
  uint32_t singular_ = 0;
};

}  // namespace voxeld::gpu
