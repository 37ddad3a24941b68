// Which parts of a tile there is something in.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

// Bit r of the 256 is for words 16·r to 16·r + 15 of a tile, a cache line.
struct TileRows {
  static constexpr size_t kGroups = kTileSize * kTileSize / 64;
  uint64_t bits[kGroups] = {};

  static TileRows All() {
    TileRows rows;
    for (uint64_t& group : rows.bits) group = ~uint64_t{0};
    return rows;
  }
  // The row of the word at `index`.
  void Add(uint32_t index) { bits[index >> 10] |= uint64_t{1} << (index >> 4 & 63); }
  bool operator==(const TileRows&) const = default;
};

}  // namespace voxeld::gpu
