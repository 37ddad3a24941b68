#include "gpu/assemble/bins.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "gpu/assemble/small_triangle.h"
#include "gpu/assemble/triangle_kernel.h"
#include "gpu/word.h"

namespace voxeld::gpu {
namespace {

constexpr uint32_t kPartItems = 2048;  // at least, where there are several parts
constexpr uint32_t kWalkRun = 256;     // made, and followed while they are in the cache
constexpr uint32_t kPointRun = 64;     // found, before a look at the limit

// Of a span: while the two arrays of those found grow, sorted, and put in order. Of what grows: old, new and a copy.
constexpr uint64_t kSpanBytes = 48, kWalkBytes = 4 * sizeof(LineWalk),
                   kUnitBytes = 3 * sizeof(TriangleRuns);
constexpr uint64_t kMostWalkBytes = 600 * kSpanBytes;  // of one walk, give or take
constexpr uint64_t kMostUncharged = 256 * kSpanBytes;  // that a part has found and not said yet

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

// What is left of a limit, which parts share.
class Room {
 public:
  explicit Room(uint64_t bytes)
      : left_(
            static_cast<int64_t>(std::min(bytes, uint64_t{std::numeric_limits<int64_t>::max()}))) {}
  void Take(uint64_t bytes) {
    left_.fetch_sub(static_cast<int64_t>(bytes), std::memory_order_relaxed);
  }
  bool exceeded() const { return left_.load(std::memory_order_relaxed) < 0; }

 private:
  std::atomic<int64_t> left_;
};

// One part of BinItems.
struct Part {
  const Source& source;
  const TileGrid& grid;
  std::span<const uint8_t> owned;
  uint32_t priority;
  bool erase, choose;
  const Box3& box;
  uint32_t run;   // walks, or triangles, between looks at the limit
  uint64_t step;  // bytes that are charged at once, at least
  Room& room;
  FoundSpans& found;
  size_t charged = 0;  // spans
  uint64_t due = 0;    // other bytes

  // False if that was too many.
  bool Charge(uint64_t others = 0) {
    due += others;
    return (found.size - charged) * kSpanBytes + due < step || ChargeAll();
  }
  bool ChargeAll() {
    room.Take((found.size - charged) * kSpanBytes + std::exchange(due, 0));
    charged = found.size;
    return !room.exceeded();
  }
  template <class Primitive>
  void FindItem(uint32_t i) {
    Primitive::EmitTiles(source, i, grid, [&](uint32_t tile) {
      if (owned[tile] != 0) found.Add(tile, {i, 0});
    });
  }
  // Of the corners of an item; what is more than a voxel away from all of these it does not touch.
  bool FarAway(std::span<const Int3> corners) const {
    for (int a = 0; a < 3; ++a) {
      const int64_t lo = (int64_t{box.lo[a]} - 1) * kUnitsPerVoxel,
                    hi = (int64_t{box.hi[a]} + 1) * kUnitsPerVoxel;
      bool below = true, above = true;
      for (const Int3& corner : corners) {
        below &= corner[a] < lo;
        above &= corner[a] > hi;
      }
      if (below || above) return true;
    }
    return false;
  }
  template <class Primitive>
  bool Chosen(uint32_t i, std::span<const Int3> corners) const {
    if (!choose) return true;
    if (FarAway(corners)) return false;
    bool any = false;
    Primitive::EmitTiles(source, i, grid, [&](uint32_t tile) { any |= owned[tile] != 0; });
    return any;
  }
};

// What BinItems does with items [first, last).
template <class Primitive>
void Find(Part& part, uint32_t first, uint32_t last) {
  // A point touches one tile, or, if it has a radius, as few as anything else.
  const uint32_t run = std::is_same_v<Primitive, Points> && part.source.radius == 0 ? kPointRun : 1;
  for (uint32_t i = first; i < last;) {
    for (const uint32_t end = std::min(last, i + run); i < end; ++i) part.FindItem<Primitive>(i);
    if (!part.Charge()) return;
  }
}

// The same of lines one voxel wide; false if some are no walks.
bool FindWalks(Part& part, bool all_owned, uint32_t first, uint32_t last, LineWalk* walks) {
  const WalkGrid walk_grid(part.grid);
  bool all = true;
  uint32_t run = first;
  const auto follow = [&](uint32_t end) {
    FindSpans(walks, run, end, walk_grid, all_owned ? nullptr : part.owned.data(), part.found);
    return part.Charge();
  };
  for (uint32_t i = first; i < last; ++i) {
    const Line line = Segments::ItemOf(part.source, i);
    if (LineWalk::Of(line, walk_grid, walks[i])) {
      walks[i].word = MakeWord(part.priority, part.erase, line.color_s);
      if (i - run < part.run) continue;
      if (!follow(i)) return false;
      run = i;
      continue;
    }
    if (!follow(i)) return false;
    run = i + 1;
    all = false;
    part.FindItem<Segments>(i);
  }
  follow(last);
  return all;
}

// The same of those that are chosen, whose walks join `chosen`.
bool FindChosenWalks(Part& part, uint32_t first, uint32_t last, BinScratch::Walks& chosen) {
  const WalkGrid walk_grid(part.grid);
  bool all = true;
  size_t run = 0;
  const auto follow = [&] {
    FindSpans(chosen.walks.data(), static_cast<uint32_t>(run), static_cast<uint32_t>(chosen.size),
              walk_grid, part.owned.data(), part.found);
    const bool fits = part.Charge((chosen.size - run) * kWalkBytes);
    run = chosen.size;
    return fits;
  };
  for (uint32_t i = first; i < last; ++i) {
    const Line line = Segments::ItemOf(part.source, i);
    const Int3 ends[2] = {line.s, line.e};
    if (!part.Chosen<Segments>(i, ends)) continue;
    chosen.walks.Reserve(chosen.size, 1);
    LineWalk& walk = chosen.walks.data()[chosen.size];
    if (LineWalk::Of(line, walk_grid, walk)) {
      walk.word = MakeWord(part.priority, part.erase, line.color_s);
      if (++chosen.size - run >= part.run && !follow()) return false;
      continue;
    }
    if (!follow()) return false;
    all = false;
    part.FindItem<Segments>(i);
  }
  follow();
  return all;
}

// The same of triangles, of which the small ones go to `memory`; false if some are not small.
bool FindTriangles(Part& part, uint32_t first, uint32_t last, uint32_t number,
                   TriangleMemory& memory) {
  const WalkGrid walk_grid(part.grid);
  SmallTriangles run;
  const auto follow = [&] {
    const size_t before = memory.size;
    FindTriangles(run, number, walk_grid, part.owned.data(), memory, part.found);
    return part.Charge((memory.size - before) * kUnitBytes);
  };
  bool all = true;
  for (uint32_t i = first; i < last; ++i) {
    const Triangle t = Triangles::ItemOf(part.source, i);
    if (!part.Chosen<Triangles>(i, t.v)) continue;
    if (run.Add(t, walk_grid, MakeWord(part.priority, part.erase, t.color[0]))) {
      if ((run.full() || run.size >= part.run) && !follow()) return false;
      continue;
    }
    all = false;
    part.FindItem<Triangles>(i);
    if (!part.Charge()) return false;
  }
  follow();
  return all;
}

// The walks of all parts one behind the other, and spans that name them there.
void JoinWalks(std::span<const BinScratch::Walks> walks, std::span<FoundSpans> parts,
               Executor& executor, Bins& bins) {
  std::vector<size_t> base;
  bins.walk_count = 0;
  for (const BinScratch::Walks& part : walks) {
    base.push_back(bins.walk_count);
    bins.walk_count += part.size;
  }
  bins.walks.Make(bins.walk_count);
  executor.For(parts.size(), 1, [&](size_t part, int) {
    std::copy_n(walks[part].walks.data(), walks[part].size, bins.walks.data() + base[part]);
    if (base[part] == 0) return;
    BinItem* const items = parts[part].items.data();
    for (size_t i = 0; i < parts[part].size; ++i) {
      if (items[i].count() != 0) items[i].item += static_cast<uint32_t>(base[part]);
    }
  });
}

// Each has a count for each tile, in a quarter of the limit.
uint32_t PartCount(uint32_t items, uint32_t tiles, Executor& executor, uint64_t bytes) {
  const auto workers = static_cast<uint32_t>(executor.concurrency());
  if (workers == 1) return 1;
  const uint64_t room =
      std::max(uint64_t{1}, bytes / 4 / (sizeof(uint32_t) * std::max(tiles, uint32_t{1})));
  const uint64_t most = std::min(uint64_t{2} * workers, room);
  return static_cast<uint32_t>(std::clamp(uint64_t{items} / kPartItems, uint64_t{1}, most));
}

}  // namespace

uint32_t ItemCount(const Source& source) {
  return WithPrimitive(source.record->kind,
                       [&](auto primitive) { return decltype(primitive)::type::Count(source); });
}

bool BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              uint32_t priority, bool erase, Executor& executor, const BinLimits& limits,
              BinScratch& scratch, Bins& bins) {
  bins.Clear();
  return WithPrimitive(source.record->kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    const uint32_t end =
        limits.choose ? std::min(limits.last, Primitive::Count(source)) : Primitive::Count(source);
    const uint32_t begin = limits.choose ? std::min(limits.first, end) : 0;
    const uint32_t count = end - begin;
    const bool limited = limits.bytes != UINT64_MAX;
    const uint32_t part_count = PartCount(count, grid.count(), executor, limits.bytes);
    if (scratch.parts.size() < part_count) scratch.parts.resize(part_count);
    const std::span<FoundSpans> parts = std::span(scratch.parts).first(part_count);
    const bool walks = std::is_same_v<Primitive, Segments> && source.radius == 0 &&
                       source.record->sampling != LineSampling::kCover;
    const bool triangles = std::is_same_v<Primitive, Triangles> && source.radius == 0 &&
                           source.record->rule == SurfaceRule::kThin;
    const bool choose_walks = walks && limits.choose;
    bins.chosen = choose_walks;
    // Rows begin at 32 bits.
    Room room(limited ? std::min(limits.bytes, kSpanBytes << 31) : UINT64_MAX);
    const auto give_up = [&] {
      bins = Bins();
      return false;
    };
    if (walks && !limits.choose) {
      room.Take(count * sizeof(LineWalk));
      if (limited && room.exceeded()) return give_up();
      bins.walk_count = count;
      bins.walks.Make(count);
    }
    if (choose_walks && scratch.walks.size() < part_count) scratch.walks.resize(part_count);
    bins.triangle_parts = triangles ? part_count : 0;
    if (bins.triangles.size() < bins.triangle_parts) bins.triangles.resize(bins.triangle_parts);
    // A look at every tile, where there are enough lines to make up for it.
    const bool all_owned = walks && !limits.choose && count >= owned.size() / 64 &&
                           std::memchr(owned.data(), 0, owned.size()) == nullptr;
    // What parts find before they look stays well below the limit.
    const auto run = static_cast<uint32_t>(std::clamp(
        limits.bytes / (4 * part_count * kMostWalkBytes), uint64_t{1}, uint64_t{kWalkRun}));
    const uint64_t step = std::min(limits.bytes / (8 * part_count), kMostUncharged);
    std::vector<uint8_t> all_fast(part_count, 0);
    executor.For(part_count, 1, [&](size_t part, int) {
      const auto first = begin + static_cast<uint32_t>(uint64_t{count} * part / part_count);
      const auto last = begin + static_cast<uint32_t>(uint64_t{count} * (part + 1) / part_count);
      parts[part].size = 0;
      Part of{source,     grid, owned, priority, erase,      limits.choose,
              limits.box, run,  step,  room,     parts[part]};
      if (choose_walks) {
        scratch.walks[part].size = 0;
        all_fast[part] = FindChosenWalks(of, first, last, scratch.walks[part]);
      } else if (walks) {
        all_fast[part] = FindWalks(of, all_owned, first, last, bins.walks.data());
      } else if (triangles) {
        TriangleMemory& memory = bins.triangles[part];
        memory.size = 0;
        all_fast[part] = FindTriangles(of, first, last, static_cast<uint32_t>(part), memory);
      } else {
        Find<Primitive>(of, first, last);
      }
      of.ChargeAll();
    });
    if (limited && room.exceeded()) return give_up();
    if (choose_walks) {
      JoinWalks(std::span(scratch.walks).first(part_count), parts, executor, bins);
    }
    bins.all_fast = std::find(all_fast.begin(), all_fast.end(), 0) == all_fast.end();
    if (part_count == 1 && parts[0].size < grid.count() / 4) {
      PutSorted(parts[0], bins);
    } else {
      PutCounted(parts, grid.count(), executor, scratch.counts, bins);
    }
    return true;
  });
}

void BinItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
              uint32_t priority, bool erase, Executor& executor, BinScratch& scratch, Bins& bins) {
  BinItems(source, grid, owned, priority, erase, executor, BinLimits(), scratch, bins);
}

void CountItems(const Source& source, const TileGrid& grid, std::span<const uint8_t> owned,
                Executor& executor, uint64_t bytes, BinScratch& scratch, Bins& bins) {
  bins = Bins();
  WithPrimitive(source.record->kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    const uint32_t count = Primitive::Count(source), tiles = grid.count();
    const uint32_t part_count = PartCount(count, tiles, executor, bytes);
    scratch.counts.assign(size_t{part_count} * tiles, 0);
    executor.For(part_count, 1, [&](size_t part, int) {
      const auto first = static_cast<uint32_t>(uint64_t{count} * part / part_count);
      const auto last = static_cast<uint32_t>(uint64_t{count} * (part + 1) / part_count);
      uint32_t* const counts = scratch.counts.data() + part * tiles;
      for (uint32_t i = first; i < last; ++i) {
        Primitive::EmitTiles(source, i, grid, [&](uint32_t tile) {
          if (owned[tile] != 0) ++counts[tile];
        });
      }
    });
    for (uint32_t tile = 0; tile < tiles; ++tile) {
      uint64_t sum = 0;
      for (uint32_t part = 0; part < part_count; ++part) {
        sum += scratch.counts[size_t{part} * tiles + tile];
      }
      if (sum == 0) continue;
      bins.tiles.push_back(tile);
      bins.counts.push_back(static_cast<uint32_t>(std::min(sum, uint64_t{UINT32_MAX})));
    }
  });
}

}  // namespace voxeld::gpu
