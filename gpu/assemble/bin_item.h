// An item of a drawable in a tile.
#pragma once

#include <cstdint>

namespace voxeld::gpu {

// Of a line that is a walk (line_walk.h), the `count` voxels from the `first` on. Of a small triangle's face
// (triangle_runs.h) at place `item` of a `part` of the drawable's triangles, what it has in `rows` rows of the tile from the
// `row`-th on, and vertices. Of any other item all it has there: `count` is 0.
struct BinItem {
  uint32_t item = 0;
  uint32_t range = 0;  // first · 2⁸ + count

  static BinItem Span(uint32_t item, uint32_t first, uint32_t count) {
    return {item, first << 8 | count};
  }
  static BinItem Face(uint32_t item, uint32_t part, uint32_t row, uint32_t rows) {
    return Span(item, part << 4 | row, rows + 1);
  }
  uint32_t part() const { return range >> 12; }
  uint32_t row() const { return range >> 8 & 15; }
  uint32_t rows() const { return count() - 1; }
  uint32_t first() const { return range >> 8; }
  uint32_t count() const { return range & 0xFF; }
  bool operator==(const BinItem&) const = default;
};

}  // namespace voxeld::gpu
