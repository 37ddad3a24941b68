// A budget for the index of items by tile, and how drawables that exceed it are drawn.
//
// A drawable whose bins fit keeps them (IndexBudget). Any other keeps, until there is room, which tiles it is in and how many
// items are in each (Bins::counts). Where such are to be seen, tiles are drawn in passes, runs of tiles with few enough of
// their items, which are found anew for each pass (PassBins). In a tile that has too many by itself they are found and drawn
// range by range.
//
// The lists of the tiles that drawables are in, and the pieces of curves, have a budget of their own. A drawable that exceeds it is
// unlisted: only the box around its tiles is kept. Each owned tile in such a box is drawn by itself, range by range.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "gpu/assemble/scene.h"
#include "gpu/assemble/tile_rows.h"
#include "gpu/cpu/executor.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

inline constexpr uint64_t kIndexBytes = uint64_t{4} << 30;

// How many bytes go where: three quarters at most to bins that are kept, an eighth at least to finding items, and as much to
// what workers find by themselves. Lists of tiles, and pieces of curves, have `list_bytes` beside that (0: a quarter of `bytes`).
class IndexBudget {
 public:
  explicit IndexBudget(uint64_t bytes, uint64_t list_bytes = 0)
      : bytes_(bytes == 0 ? kIndexBytes : bytes),
        list_bytes_(list_bytes == 0 ? bytes_ / 4 : list_bytes) {}

  // Charges what the bins of a drawable, and `inside`, hold now, instead of what they held. False if too much would be kept:
  // then they have no items, and hold nothing. For different drawables by several threads.
  bool Keep(Drawable& drawable);
  // The bins go, and `inside`.
  void Release(Drawable& drawable);
  // Charges the lists of the drawable's tiles, and its cut, instead of what they were charged before. False if there is no room:
  // then nothing is charged, and the caller drops them. For different drawables by several threads.
  bool TryChargeLists(Drawable& drawable);
  // Releases what TryChargeLists has charged.
  void ReleaseLists(Drawable& drawable);
  uint64_t listed_bytes() const { return listed_.load(std::memory_order_relaxed); }
  // Whether the smallest charge that was refused since this was last true would fit now.
  bool RefusedWouldFit();
  uint64_t kept_bytes() const { return kept_.load(std::memory_order_relaxed); }
  // For all workers in turns: to find items, or for a pass.
  uint64_t room() const { return bytes_ - bytes_ / 8 - kept_bytes(); }
  // Finding keeps its memory up to this.
  uint64_t room_to_keep() const { return bytes_ / 8; }
  // For each of so many workers at once.
  uint64_t room_of_worker(int workers) const { return bytes_ / 8 / static_cast<uint64_t>(workers); }

 private:
  void Charge(Drawable& drawable, uint64_t bytes);

  const uint64_t bytes_, list_bytes_;
  std::atomic<uint64_t> kept_{0}, listed_{0}, least_refused_{UINT64_MAX};
};

// Finds the items of a drawable that is mapped, in `bytes` at most together with what `scratch` holds already. False if they
// need more; then its bins are empty.
bool FindBins(const Drawable& drawable, const TileGrid& grid, std::span<const uint8_t> owned,
              Executor& executor, BinLimits limits, BinScratch& scratch, Bins& bins);

// [begin, end) of the tiles to be drawn.
struct TileRun {
  size_t begin = 0, end = 0;
};
// Cuts tiles with so many items each into runs, as long as they may be, whose items are expected to fit into
// `bytes`; each has a tile at least.
std::vector<TileRun> PlanPasses(std::span<const uint64_t> items, uint64_t bytes);

// The items of counted drawables in the tiles of a pass.
class PassBins {
 public:
  explicit PassBins(Executor& executor) : executor_(executor) {}

  // Of these drawables, in `tiles`, in `bytes` at most. False if that does not suffice.
  bool Fill(std::span<const Drawable* const> drawables, std::span<const uint32_t> tiles,
            const TileGrid& grid, uint64_t bytes);
  // For one tile, whose items need not fit; by one thread, which Draw then works from.
  void FillByRanges(uint32_t tile, const TileGrid& grid, uint64_t bytes);
  // DrawItems, of a drawable that it was filled with, in one of its tiles.
  void Draw(const Drawable& drawable, uint32_t tile, const Box3& box, uint32_t* words,
            TileRows& touched);
  // Nothing is held.
  void Release();

  uint64_t bytes() const { return held_ + scratch_.bytes(); }
  // The most there was so far.
  uint64_t most_bytes() const { return most_; }

 private:
  void DrawByRanges(const Drawable& drawable, const Box3& box, uint32_t* words, TileRows& touched);
  bool FindIn(size_t slot, const Drawable& drawable, BinLimits limits);
  void Want(std::span<const uint32_t> tiles, const TileGrid& grid);

  Executor& executor_;
  TileGrid grid_;
  std::vector<uint8_t> wanted_;  // by tile
  std::vector<uint32_t> tiles_;  // the wanted ones
  Box3 box_;                     // around them
  bool by_ranges_ = false;
  uint64_t limit_ = 0, held_ = 0, most_ = 0;
  absl::flat_hash_map<const Drawable*, size_t> slot_of_;
  std::vector<Bins> slots_;  // used again
  BinScratch scratch_;
};

}  // namespace voxeld::gpu
