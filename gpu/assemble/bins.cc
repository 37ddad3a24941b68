#include "gpu/assemble/bins.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "gpu/assemble/small_triangle.h"
#include "gpu/assemble/triangle_kernel.h"
#include "gpu/word.h"

namespace voxeld::gpu {
namespace {

constexpr uint32_t kPartItems = 2048;  // at least, where there are several parts
constexpr uint32_t kWalkRun = 256;     // made, and followed while they are in the cache

constexpr size_t kAhead = 48;  // items whose places are fetched before they are written

// Few: sorted as numbers, the tile in the upper, the place in the lower 32 bits.
void PutSorted(const FoundSpans& found, Bins& bins) {
  std::vector<uint64_t> order(found.size);
  for (size_t i = 0; i < found.size; ++i) order[i] = uint64_t{found.tiles.data()[i]} << 32 | i;
  std::sort(order.begin(), order.end());
  bins.items.Make(found.size);
  for (size_t i = 0; i < found.size; ++i) {
    const auto tile = static_cast<uint32_t>(order[i] >> 32);
    if (bins.tiles.empty() || bins.tiles.back() != tile) {
      bins.tiles.push_back(tile);
      bins.begin.push_back(static_cast<uint32_t>(i));
    }
    bins.items.data()[i] = found.items.data()[static_cast<uint32_t>(order[i])];
  }
  bins.begin.push_back(static_cast<uint32_t>(found.size));
}

// Many: counted tile by tile, each part by itself. Parts come in the order of their items.
void PutCounted(std::span<const FoundSpans> parts, uint32_t tile_count, Executor& executor,
                std::vector<uint32_t>& counts, Bins& bins) {
  counts.resize(parts.size() * tile_count);
  executor.For(parts.size(), 1, [&](size_t part, int) {
    uint32_t* const count = counts.data() + part * tile_count;
    std::fill(count, count + tile_count, 0);
    const uint32_t* const tiles = parts[part].tiles.data();
    for (size_t i = 0; i < parts[part].size; ++i) ++count[tiles[i]];
  });
  uint32_t at = 0;
  for (uint32_t tile = 0; tile < tile_count; ++tile) {
    const uint32_t begin = at;
    for (size_t part = 0; part < parts.size(); ++part) {
      at += std::exchange(counts[part * tile_count + tile], at);
    }
    if (at == begin) continue;
    bins.tiles.push_back(tile);
    bins.begin.push_back(begin);
  }
  bins.begin.push_back(at);
  bins.items.Make(at);
  executor.For(parts.size(), 1, [&](size_t part, int) {
    uint32_t* const place = counts.data() + part * tile_count;
    const uint32_t* const tiles = parts[part].tiles.data();
    const BinItem* const items = parts[part].items.data();
    BinItem* const to = bins.items.data();
    const size_t size = parts[part].size;
    for (size_t i = 0; i < size; ++i) {
      if (i + kAhead < size) __builtin_prefetch(to + place[tiles[i + kAhead]], /*rw=*/1);
      to[place[tiles[i]]++] = items[i];
    }
  });
}

// What BinItems does with items [first, last).
template <class Primitive>
void Find(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
          uint32_t first, uint32_t last, FoundSpans& found) {
  for (uint32_t i = first; i < last; ++i) {
    Primitive::EmitTiles(source, i, grid, [&](uint32_t tile) {
      if (owned[tile] != 0) found.Add(tile, {i, 0});
    });
  }
}

// The same of lines one voxel wide; false if some are no walks.
bool FindWalks(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
               bool all_owned, uint32_t priority, bool erase, uint32_t first, uint32_t last,
               LineWalk* walks, FoundSpans& found) {
  const WalkGrid walk_grid(grid);
  bool all = true;
  uint32_t run = first;
  const auto follow = [&](uint32_t end) {
    FindSpans(walks, run, end, walk_grid, all_owned ? nullptr : owned.data(), found);
  };
  for (uint32_t i = first; i < last; ++i) {
    const Line line = Segments::ItemOf(source, i);
    if (LineWalk::Of(line, walk_grid, walks[i])) {
      walks[i].word = MakeWord(priority, erase, line.color_s);
      if (i - run < kWalkRun) continue;
      follow(i);
      run = i;
      continue;
    }
    follow(i);
    run = i + 1;
    all = false;
    Find<Segments>(source, grid, owned, i, i + 1, found);
  }
  follow(last);
  return all;
}

// The same of triangles, of which the small ones go to `memory`; false if some are not small.
bool FindTriangles(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
                   uint32_t priority, bool erase, uint32_t first, uint32_t last, uint32_t part,
                   TriangleMemory& memory, FoundSpans& found) {
  const WalkGrid walk_grid(grid);
  SmallTriangles run;
  const auto follow = [&] { FindTriangles(run, part, walk_grid, owned.data(), memory, found); };
  bool all = true;
  for (uint32_t i = first; i < last; ++i) {
    const Triangle t = Triangles::ItemOf(source, i);
    if (run.Add(t, walk_grid, MakeWord(priority, erase, t.color[0]))) {
      if (run.full()) follow();
      continue;
    }
    all = false;
    Find<Triangles>(source, grid, owned, i, i + 1, found);
  }
  follow();
  return all;
}

}  // namespace

void BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              uint32_t priority, bool erase, Executor& executor, BinScratch& scratch, Bins& bins) {
  bins.Clear();
  WithPrimitive(source.record->kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    const uint32_t count = Primitive::Count(source);
    const auto workers = static_cast<uint32_t>(executor.concurrency());
    const uint32_t part_count =
        workers == 1 ? 1 : std::clamp(count / kPartItems, uint32_t{1}, 2 * workers);
    if (scratch.parts.size() < part_count) scratch.parts.resize(part_count);
    const std::span<FoundSpans> parts = std::span(scratch.parts).first(part_count);
    const bool walks = std::is_same_v<Primitive, Segments> && source.radius == 0 &&
                       source.record->sampling != LineSampling::kCover;
    const bool triangles =
        std::is_same_v<Primitive, Triangles> && source.record->rule == SurfaceRule::kThin;
    bins.walk_count = walks ? count : 0;
    bins.walks.Make(bins.walk_count);
    bins.triangle_parts = triangles ? part_count : 0;
    if (bins.triangles.size() < bins.triangle_parts) bins.triangles.resize(bins.triangle_parts);
    // A look at every tile, where there are enough lines to make up for it.
    const bool all_owned = walks && count >= owned.size() / 64 &&
                           std::memchr(owned.data(), 0, owned.size()) == nullptr;
    std::vector<uint8_t> all_fast(part_count, 0);
    executor.For(part_count, 1, [&](size_t part, int) {
      const auto first = static_cast<uint32_t>(uint64_t{count} * part / part_count);
      const auto last = static_cast<uint32_t>(uint64_t{count} * (part + 1) / part_count);
      FoundSpans& found = parts[part];
      found.size = 0;
      if (walks) {
        all_fast[part] = FindWalks(source, grid, owned, all_owned, priority, erase, first, last,
                                   bins.walks.data(), found);
      } else if (triangles) {
        TriangleMemory& memory = bins.triangles[part];
        memory.size = 0;
        all_fast[part] = FindTriangles(source, grid, owned, priority, erase, first, last,
                                       static_cast<uint32_t>(part), memory, found);
      } else {
        Find<Primitive>(source, grid, owned, first, last, found);
      }
    });
    bins.all_fast = std::find(all_fast.begin(), all_fast.end(), 0) == all_fast.end();
    if (part_count == 1 && parts[0].size < grid.count() / 4) return PutSorted(parts[0], bins);
    PutCounted(parts, grid.count(), executor, scratch.counts, bins);
  });
}

}  // namespace voxeld::gpu
