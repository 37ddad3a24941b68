#include "gpu/assemble/bins.h"

#include <algorithm>

namespace voxeld::gpu {
namespace {

constexpr uint32_t kChunkItems = 4096;

// A tile in the upper, an item in the lower 32 bits.
using Pair = uint64_t;

uint32_t TileOf(Pair pair) { return static_cast<uint32_t>(pair >> 32); }
uint32_t ItemOf(Pair pair) { return static_cast<uint32_t>(pair); }

void Append(Bins& bins, Pair pair) {
  if (bins.tiles.empty() || bins.tiles.back() != TileOf(pair)) {
    bins.tiles.push_back(TileOf(pair));
    bins.begin.push_back(static_cast<uint32_t>(bins.items.size()));
  }
  bins.items.push_back(ItemOf(pair));
}

// Few pairs: sorted as numbers.
Bins FromSorted(std::vector<Pair> pairs) {
  std::sort(pairs.begin(), pairs.end());
  Bins bins;
  bins.items.reserve(pairs.size());
  for (Pair pair : pairs) Append(bins, pair);
  bins.begin.push_back(static_cast<uint32_t>(bins.items.size()));
  return bins;
}

// Many: counted tile by tile. Chunks come in the order of their items.
Bins FromCounted(const std::vector<std::vector<Pair>>& chunks, uint32_t tile_count) {
  std::vector<uint32_t> at(size_t{tile_count} + 1, 0);
  for (const std::vector<Pair>& chunk : chunks) {
    for (Pair pair : chunk) ++at[TileOf(pair) + 1];
  }
  Bins bins;
  for (uint32_t tile = 0; tile < tile_count; ++tile) {
    if (at[tile + 1] != 0) {
      bins.tiles.push_back(tile);
      bins.begin.push_back(at[tile]);
    }
    at[tile + 1] += at[tile];
  }
  bins.begin.push_back(at[tile_count]);
  bins.items.resize(at[tile_count]);
  for (const std::vector<Pair>& chunk : chunks) {
    for (Pair pair : chunk) bins.items[at[TileOf(pair)]++] = ItemOf(pair);
  }
  return bins;
}

}  // namespace

Bins BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              Executor& executor) {
  return WithPrimitive(source.record->kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    const uint32_t count = Primitive::Count(source);
    const size_t chunk_count = (size_t{count} + kChunkItems - 1) / kChunkItems;
    std::vector<std::vector<Pair>> chunks(chunk_count);
    executor.For(chunk_count, 1, [&](size_t chunk, int) {
      const uint32_t first = static_cast<uint32_t>(chunk) * kChunkItems;
      const uint32_t last = std::min(count - first, kChunkItems) + first;
      for (uint32_t i = first; i < last; ++i) {
        Primitive::EmitTiles(source, i, grid, [&](uint32_t tile) {
          if (owned[tile] != 0) chunks[chunk].push_back(Pair{tile} << 32 | i);
        });
      }
    });
    size_t pairs = 0;
    for (const std::vector<Pair>& chunk : chunks) pairs += chunk.size();
    if (chunk_count == 1 && pairs < grid.count()) return FromSorted(std::move(chunks[0]));
    return FromCounted(chunks, grid.count());
  });
}

}  // namespace voxeld::gpu
