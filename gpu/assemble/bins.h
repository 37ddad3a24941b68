// Which items of a drawable may lie in which tiles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "gpu/cpu/executor.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu {

// Compressed rows: tile tiles[r] has items[begin[r] .. begin[r+1]).
// Tiles ascend, so do a row's items.
struct Bins {
  std::vector<uint32_t> tiles;
  std::vector<uint32_t> begin;
  std::vector<uint32_t> items;

  std::span<const uint32_t> row(size_t r) const {
    return std::span(items).subspan(begin[r], begin[r + 1] - begin[r]);
  }
};

// `owned[tile]`: 0 leaves the tile out.
Bins BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              Executor& executor);

}  // namespace voxeld::gpu
