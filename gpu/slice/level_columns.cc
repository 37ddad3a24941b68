#include "gpu/slice/level_columns.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "gpu/primitives/grid.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kMostChunks = 64;  // the number of bits in lit_
// Above this limit, sampling pixel by pixel is no worse.
constexpr uint64_t kMostLevelBytes = uint64_t{1} << 30;
constexpr size_t kColumnsATask = 64;
constexpr size_t kBlocks = kChunkRows / kBlockWords;  // of a chunk
static_assert(kBlockWords == kTileSize, "a run of a chunk's rows lies in one tile");

constexpr uint32_t kNoLight[kBlockWords] = {};

// Returns the voxel of row 0 if, in every set of inner lists, row v takes its colour only from the
// voxel v further on.
std::optional<int32_t> FirstOfStraightRows(const display::FootprintTable& table, int axis) {
  std::optional<int32_t> first;
  for (int32_t set = 0; set < table.inner_sets; ++set) {
    for (int32_t v = 0; v < table.height; ++v) {
      const auto list = table.Inner(set, v);
      if (list.size() != 1) return std::nullopt;
      const int32_t at[3] = {list[0].x, list[0].y, list[0].z};
      for (int a = 0; a < 3; ++a) {
        if (a != axis && at[a] != 0) return std::nullopt;
      }
      if (!first) first = at[axis];
      if (at[axis] != *first + v) return std::nullopt;
    }
  }
  return first;
}

// Tests that outer entries do not use the inner axis; those of lattices may.
bool AreFlat(const display::FootprintLists& outer, int axis) {
  return std::all_of(outer.entries.begin(), outer.entries.end(), [axis](const auto& e) {
    const int32_t at[3] = {e.x, e.y, e.z};
    return at[axis] == 0;
  });
}

using List = std::span<const display::FootprintEntry>;

struct Less {
  bool operator()(const List& a, const List& b) const {
    const auto key = [](const display::FootprintEntry& e) {
      return uint64_t{e.z} << 32 | uint64_t{e.y} << 16 | e.x;
    };
    return std::lexicographical_compare(
        a.begin(), a.end(), b.begin(), b.end(),
        [&](const auto& p, const auto& q) { return key(p) < key(q); });
  }
};

}  // namespace

std::optional<LevelColumns> LevelColumns::Create(const display::FootprintTable& table,
                                                 const TileGrid& grid,
                                                 const display::FrameLayout& layout,
                                                 const display::Tone& tone, int32_t begin,
                                                 int32_t end) {
  if (layout.format != display::PixelFormat::kRgb332 || tone.sampling != display::Sampling::kMax ||
      table.flat_row != 0) {
    return std::nullopt;
  }
  const int axis = static_cast<int>(table.inner_axis);
  const std::optional<int32_t> first = FirstOfStraightRows(table, axis);
  if (!first || *first % kTileSize != 0 || grid.shift[axis] != 0) return std::nullopt;
  if (!AreFlat(table.outer, axis)) return std::nullopt;

  LevelColumns out;
  out.width_ = static_cast<size_t>(layout.width);
  out.height_ = static_cast<size_t>(layout.height);
  out.columns_ = (out.width_ + kColumnsTogether - 1) / kColumnsTogether * kColumnsTogether;
  out.chunks_ = (out.height_ + kChunkRows - 1) / kChunkRows;
  if (out.chunks_ > kMostChunks) return std::nullopt;
  out.begin_ = begin;
  out.axis_ = axis;
  out.first_ = *first;
  out.tiles_along_ = grid.tiles[axis];
  out.tile_step_ = 1;
  for (int a = 0; a < axis; ++a) out.tile_step_ *= static_cast<uint32_t>(grid.tiles[a]);

  const size_t uses = static_cast<size_t>(end - begin) * out.width_;
  std::map<List, uint32_t, Less> known;
  out.voxel_begin_ = {0, 0};  // for kDark
  out.column_of_.reserve(uses);
  for (int32_t slice = begin; slice < end; ++slice) {
    for (int32_t u = 0; u < layout.width; ++u) {
      const List list = table.Outer(slice, u);
      uint32_t column = kDark;
      if (!list.empty()) {
        const auto [at, is_new] =
            known.try_emplace(list, static_cast<uint32_t>(out.voxel_begin_.size() - 1));
        column = at->second;
        if (is_new) out.AddColumn(grid, list);
      }
      out.column_of_.push_back(column);
    }
    const bool seldom_shared = known.size() > uses / 2;
    if (seldom_shared) return std::nullopt;
  }
  const size_t columns = out.voxel_begin_.size() - 1;
  out.level_bytes_ = uint64_t{columns} * out.chunks_ * kChunkBytes;
  if (out.level_bytes_ > kMostLevelBytes) return std::nullopt;
  out.levels_ = std::make_unique_for_overwrite<ChunkLevels[]>(columns * out.chunks_);
  out.lit_.assign(columns, 0);
  out.SortColumns(grid);
  out.IndexPillars(grid);
  out.tables_ = LevelTables::OfRgb332(layout, tone);
  const auto sub_frames = static_cast<uint32_t>(layout.sub_frames);
  for (uint32_t sub = 0; sub < sub_frames; ++sub) {
    for (uint32_t u = 0; u < 8; ++u) out.dither_.push_back(DitherColumn(u, sub, sub_frames));
  }
  return out;
}

void LevelColumns::AddColumn(const TileGrid& grid, List list) {
  for (const display::FootprintEntry& e : list) {
    voxels_.push_back({grid.TileOf(e.x, e.y, e.z), grid.IndexInTile(e.x, e.y, e.z)});
  }
  voxel_begin_.push_back(static_cast<uint32_t>(voxels_.size()));
}

size_t LevelColumns::PillarOf(const TileGrid& grid, uint32_t tile) const {
  int32_t ijk[3];
  grid.Coordinates(tile, ijk);
  const int a = axis_ == 0 ? 1 : 0, b = axis_ == 2 ? 1 : 2;  // the outer axes
  return static_cast<size_t>(ijk[b]) * static_cast<size_t>(grid.tiles[a]) +
         static_cast<size_t>(ijk[a]);
}

// Sorts columns in the order of the voxels' memory: columns of one voxel per row first, tile by
// tile, then the others.
void LevelColumns::SortColumns(const TileGrid& grid) {
  std::vector<uint32_t> order(lit_.size() - 1);  // kDark keeps its place
  std::iota(order.begin(), order.end(), kDark + 1);
  const auto key = [&](uint32_t column) {
    const std::span<const Voxel> voxels = VoxelsOf(column);
    return std::tuple(voxels.size() > 1, PillarOf(grid, voxels[0].tile), voxels[0].index);
  };
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
  std::vector<uint32_t> place(lit_.size(), kDark), begin = {0, 0};
  std::vector<Voxel> voxels;
  for (const uint32_t column : order) {
    place[column] = static_cast<uint32_t>(begin.size() - 1);
    const std::span<const Voxel> of = VoxelsOf(column);
    voxels.insert(voxels.end(), of.begin(), of.end());
    begin.push_back(static_cast<uint32_t>(voxels.size()));
  }
  voxel_begin_ = std::move(begin);
  voxels_ = std::move(voxels);
  for (uint32_t& column : column_of_) column = place[column];
}

void LevelColumns::IndexPillars(const TileGrid& grid) {
  const size_t pillars = grid.count() / static_cast<size_t>(tiles_along_);
  std::vector<std::vector<Single>> singles(pillars);
  std::vector<std::vector<uint32_t>> others(pillars);
  for (uint32_t column = 0; column < lit_.size(); ++column) {
    const std::span<const Voxel> voxels = VoxelsOf(column);
    for (const Voxel& voxel : voxels) {
      const size_t pillar = PillarOf(grid, voxel.tile);
      if (voxels.size() == 1) {
        singles[pillar].push_back({column, voxel.index});
      } else if (others[pillar].empty() || others[pillar].back() != column) {
        others[pillar].push_back(column);
      }
    }
  }
  pillars_.resize(pillars);
  for (uint32_t tile = 0; tile < grid.count(); ++tile) {
    Pillar& pillar = pillars_[PillarOf(grid, tile)];
    pillar.first_tile = std::min(pillar.first_tile, tile);
  }
  for (size_t i = 0; i < pillars; ++i) {
    pillars_[i].singles = static_cast<uint32_t>(singles_.size());
    pillars_[i].others = static_cast<uint32_t>(others_.size());
    singles_.insert(singles_.end(), singles[i].begin(), singles[i].end());
    others_.insert(others_.end(), others[i].begin(), others[i].end());
    pillars_[i].singles_end = static_cast<uint32_t>(singles_.size());
    pillars_[i].others_end = static_cast<uint32_t>(others_.size());
  }
}

// Chunks that wait to be computed: as many as can be fetched from farther caches at once.
class LevelColumns::Waiting {
 public:
  explicit Waiting(const LevelTables& tables) : tables_(tables) {}
  ~Waiting() { Flush(); }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

  ChunkToLevel& next() { return chunks_[count_]; }
  // Returns memory for data that next() refers to, valid until it is computed.
  uint32_t* room() { return room_[count_]; }
  void Add() {
    for (const uint32_t* words : chunks_[count_].words) __builtin_prefetch(words);
    for (const uint32_t* words : chunks_[count_].also) __builtin_prefetch(words);
    if (++count_ == kMost) Flush();
  }

 private:
  void Flush() {
    LevelChunks(tables_, std::span(chunks_, count_));
    count_ = 0;
  }

  static constexpr size_t kMost = 32;
  const LevelTables& tables_;
  size_t count_ = 0;
  ChunkToLevel chunks_[kMost];
  alignas(64) uint32_t room_[kMost][kChunkRows];
};

void LevelColumns::Update(const TileStore& tiles, std::span<const uint32_t> changed,
                          Executor& executor) {
  std::vector<uint8_t> pillar_seen(pillars_.size()), seen(lit_.size());
  std::vector<uint32_t> pillars, others;
  for (const uint32_t tile : changed) {
    const size_t i = PillarOf(tiles.grid(), tile);
    if (std::exchange(pillar_seen[i], 1) != 0) continue;
    pillars.push_back(static_cast<uint32_t>(i));
    for (uint32_t n = pillars_[i].others; n < pillars_[i].others_end; ++n) {
      if (std::exchange(seen[others_[n]], 1) == 0) others.push_back(others_[n]);
    }
  }
  executor.For(pillars.size(), 1,
               [&](size_t i, int) { LevelSingles(tiles, pillars_[pillars[i]]); });
  const size_t tasks = (others.size() + kColumnsATask - 1) / kColumnsATask;
  executor.For(tasks, 1, [&](size_t task, int) {
    const size_t at = task * kColumnsATask;
    LevelOthers(tiles, std::span(others).subspan(at, std::min(kColumnsATask, others.size() - at)));
  });
}

// Computes the levels of columns of one voxel per row.
void LevelColumns::LevelSingles(const TileStore& tiles, const Pillar& pillar) {
  Waiting waiting(tables_);
  for (size_t chunk = 0; chunk < chunks_; ++chunk) {
    const uint32_t* colors[kBlocks] = {};
    bool any = false;
    for (size_t block = 0; block < kBlocks; ++block) {
      colors[block] = ColorsAt(tiles, pillar.first_tile, chunk, block);
      any |= colors[block] != nullptr;
    }
    const uint64_t bit = uint64_t{1} << chunk;
    for (uint32_t n = pillar.singles; n < pillar.singles_end; ++n) {
      const auto [column, index] = singles_[n];
      lit_[column] = any ? lit_[column] | bit : lit_[column] & ~bit;
      if (!any) continue;
      ChunkToLevel& to = waiting.next();
      for (size_t block = 0; block < kBlocks; ++block) {
        to.words[block] = colors[block] != nullptr ? colors[block] + index : kNoLight;
        to.also[block] = nullptr;
      }
      to.levels = levels(column, chunk);
      waiting.Add();
    }
  }
}

void LevelColumns::LevelOthers(const TileStore& tiles, std::span<const uint32_t> columns) {
  Waiting waiting(tables_);
  for (const uint32_t column : columns) {
    uint64_t lit = 0;
    for (size_t chunk = 0; chunk < chunks_; ++chunk) {
      ChunkToLevel& to = waiting.next();
      bool any = false;
      for (size_t block = 0; block < kBlocks; ++block) {
        const uint32_t* words[2] = {kNoLight, kNoLight};
        size_t count = 0;
        for (const Voxel& voxel : VoxelsOf(column)) {
          const uint32_t* colors = ColorsAt(tiles, voxel.tile, chunk, block);
          if (colors == nullptr) continue;
          if (count < 2) {
            words[count++] = colors + voxel.index;
            continue;
          }
          uint32_t* const most = waiting.room() + block * kBlockWords;  // more than two are rare
          for (size_t v = 0; v < kBlockWords; ++v) {
            most[v] = std::max(words[1][v], colors[voxel.index + v]);
          }
          words[1] = most;
        }
        to.words[block] = words[0];
        to.also[block] = words[1];
        any |= count > 0;
      }
      if (!any) continue;
      lit |= uint64_t{1} << chunk;
      to.levels = levels(column, chunk);
      waiting.Add();
    }
    lit_[column] = lit;
  }
}

const uint32_t* LevelColumns::ColorsAt(const TileStore& tiles, uint32_t first_tile, size_t chunk,
                                       size_t block) const {
  const int32_t along = first_ / kTileSize + static_cast<int32_t>(chunk * kBlocks + block);
  if (along >= tiles_along_) return nullptr;
  return tiles.colors(first_tile + static_cast<uint32_t>(along) * tile_step_);
}

void LevelColumns::Draw(std::span<const int32_t> slices, uint32_t sub, Scratch& scratch) const {
  const size_t places = chunks_ * columns_;
  scratch.levels.resize(slices.size() * places);
  scratch.pixels.resize(slices.size() * picture_bytes());
  for (size_t i = 0; i < slices.size(); ++i) {
    const uint32_t* const of = &column_of_[static_cast<size_t>(slices[i] - begin_) * width_];
    for (size_t chunk = 0; chunk < chunks_; ++chunk) {
      const uint8_t** const to = &scratch.levels[i * places + chunk * columns_];
      for (size_t u = 0; u < width_; ++u) {
        const bool lit = (lit_[of[u]] >> chunk & 1) != 0;
        to[u] = lit ? levels(of[u], chunk) : nullptr;
      }
      std::fill(to + width_, to + columns_, nullptr);
    }
  }
  uint64_t dither[8];
  std::copy_n(&dither_[size_t{sub} * 8], 8, dither);
  DrawRgb332(scratch.levels, columns_, chunks_, dither, scratch.pixels.data());
  for (size_t i = 0; i < slices.size() && columns_ != width_; ++i) {
    uint8_t* const rows = scratch.pixels.data() + i * picture_bytes();
    for (size_t row = 1; row < height_; ++row) {
      std::memmove(rows + row * width_, rows + row * columns_, width_);
    }
  }
}

}  // namespace voxeld::gpu
