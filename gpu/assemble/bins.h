// Which items of a drawable may lie in which tiles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "gpu/assemble/bin_item.h"
#include "gpu/assemble/span_kernel.h"
#include "gpu/assemble/triangle_runs.h"
#include "gpu/cpu/executor.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu {

// Compressed rows: tile tiles[r] has items begin[r] .. begin[r+1].
// Tiles ascend, so do a row's items. Or, of a drawable with more items than are kept, tiles and counts alone.
struct Bins {
  std::vector<uint32_t> tiles;
  std::vector<uint32_t> begin;
  std::vector<uint32_t>
      counts;  // items in tile tiles[r], or a few more; empty if the items are there
  Buffer<BinItem> items;
  // Of lines one voxel wide, by item (undefined for items that are none), or those that were chosen.
  Buffer<LineWalk> walks;
  // Of small triangles, by part of the items.
  std::vector<TriangleMemory> triangles;
  size_t walk_count = 0, triangle_parts = 0;
  bool all_fast = false;  // every item is one of these
  bool chosen = false;    // walks are those that were chosen: others than walks have no place there

  std::span<const BinItem> row(size_t r) const {
    return std::span(items.data() + begin[r], begin[r + 1] - begin[r]);
  }
  size_t size() const { return begin.empty() ? 0 : begin.back(); }
  bool counted() const { return !counts.empty(); }
  // Of items and what they refer to; what is kept of tiles is not among them.
  uint64_t item_bytes() const {
    uint64_t bytes = items.capacity_bytes() + walks.capacity_bytes();
    for (const TriangleMemory& part : triangles) bytes += part.units.capacity_bytes();
    return bytes;
  }
  // Empty, with the memory that it has.
  void Clear() {
    tiles.clear();
    begin.clear();
    counts.clear();
    walk_count = triangle_parts = 0;
    all_fast = chosen = false;
  }
};

// Memory of BinItems, to be used again.
struct BinScratch {
  struct Walks {
    Buffer<LineWalk> walks;
    size_t size = 0;
  };
  std::vector<FoundSpans> parts;
  std::vector<Walks> walks;  // that were chosen, by part
  std::vector<uint32_t> counts;

  uint64_t bytes() const {
    uint64_t bytes = counts.capacity() * sizeof(counts[0]);
    for (const FoundSpans& part : parts) {
      bytes += part.tiles.capacity_bytes() + part.items.capacity_bytes();
    }
    for (const Walks& part : walks) bytes += part.walks.capacity_bytes();
    return bytes;
  }
};

struct BinLimits {
  // Of what is allocated for items: in the scratch while they are found, and in the bins. One item's in
  // the tiles that are owned, and a count for each tile, always have room.
  uint64_t bytes = UINT64_MAX;
  // Items [first, last), where there are that many, of which those are chosen that may touch a tile that is owned: for few
  // tiles, all of which lie in the voxels `box`. Else all.
  bool choose = false;
  Box3 box = {};
  uint32_t first = 0, last = UINT32_MAX;
};

// `owned[tile]`: 0 leaves the tile out. `bins` is cleared, and keeps its memory. False if the items exceed
// limits.bytes: then `bins` is empty and has none.
bool BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              uint32_t priority, bool erase, Executor& executor, const BinLimits& limits,
              BinScratch& scratch, Bins& bins);
void BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              uint32_t priority, bool erase, Executor& executor, BinScratch& scratch, Bins& bins);

// Tiles and counts alone. The scratch needs no room for items, and for counts a quarter of `bytes`, or that of one for each
// tile.
void CountItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
                Executor& executor, uint64_t bytes, BinScratch& scratch, Bins& bins);

uint32_t ItemCount(const Source& source);

}  // namespace voxeld::gpu
