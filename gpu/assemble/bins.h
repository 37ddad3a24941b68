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
// Tiles ascend, so do a row's items.
struct Bins {
  std::vector<uint32_t> tiles;
  std::vector<uint32_t> begin;
  Buffer<BinItem> items;
  // By item, of lines one voxel wide; undefined for items that are none.
  Buffer<LineWalk> walks;
  // Of small triangles, by part of the items.
  std::vector<TriangleMemory> triangles;
  size_t walk_count = 0, triangle_parts = 0;
  bool all_fast = false;  // every item is one of these

  std::span<const BinItem> row(size_t r) const {
    return std::span(items.data() + begin[r], begin[r + 1] - begin[r]);
  }
  size_t size() const { return begin.empty() ? 0 : begin.back(); }
  // Empty, with the memory that it has.
  void Clear() {
    tiles.clear();
    begin.clear();
    walk_count = triangle_parts = 0;
    all_fast = false;
  }
};

// Memory of BinItems, to be used again.
struct BinScratch {
  std::vector<FoundSpans> parts;
  std::vector<uint32_t> counts;
};

// `owned[tile]`: 0 leaves the tile out. `bins` is cleared, and keeps its memory.
void BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              uint32_t priority, bool erase, Executor& executor, BinScratch& scratch, Bins& bins);

}  // namespace voxeld::gpu
