// The loops over spans and words that assembly spends its time in, for the widest vectors that the processor has; the
// same bytes in all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "gpu/assemble/bin_item.h"
#include "gpu/assemble/buffer.h"
#include "gpu/assemble/line_walk.h"
#include "gpu/assemble/tile_rows.h"

namespace voxeld::gpu {

// Spans as they are found, and the tile of each.
struct FoundSpans {
  Buffer<uint32_t> tiles;
  Buffer<BinItem> items;
  size_t size = 0;

  void Add(uint32_t tile, BinItem item) {
    tiles.Reserve(size, 1);
    items.Reserve(size, 1);
    tiles.data()[size] = tile;
    items.data()[size++] = item;
  }
};

// Appends the spans of walks [first, last) in the tiles with owned[tile] != 0, or in all if there is no `owned`; each
// walk's together, in any order.
void FindSpans(const LineWalk* walks, uint32_t first, uint32_t last, const WalkGrid& grid,
               const uint8_t* owned, FoundSpans& found);

// Raises `words` of a tile to those of walks[item] for each span; items of count 0 are left out. The rows that it may
// have reached join `touched`.
void DrawSpans(const LineWalk* walks, std::span<const BinItem> items, uint32_t* words,
               TileRows& touched);

// Words of a layer as it looks over black in full opacity, in place; returns how many are not black. What is not in
// `touched` is 0.
uint32_t ShowWords(uint32_t* words, const TileRows& touched, TileRows& rows);
// The same of what is colours already.
uint32_t LitColors(const uint32_t* colors, TileRows& rows);

// Moves a tile's colours, which lie in `rows`, to `held`, of which what is not black lies in `held_rows`; leaves zeros. False
// if it held the same. `past_caches`: for volumes that the caches would not keep; other threads see what went past them
// only after FinishMoves() in this one.
bool MoveColors(uint32_t* colors, const TileRows& rows, bool past_caches, uint32_t* held,
                const TileRows& held_rows);
void FinishMoves();

struct MovedWords {
  uint32_t lit;  // not black
  bool differ;   // from what was held
};
// ShowWords, and MoveColors of what comes out, in one go; `held_rows` become those of what is held then.
MovedWords MoveWords(uint32_t* words, const TileRows& touched, bool past_caches, uint32_t* held,
                     TileRows& held_rows);

// The instruction set in use.
std::string SpanTarget();

}  // namespace voxeld::gpu
