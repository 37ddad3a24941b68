#include "gpu/slice/sampler.h"

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/slice/lit_bits.h"
#include "gpu/slice/weight.h"
#include "gpu/word.h"

namespace voxeld::gpu {
namespace {

using Offset = std::array<int32_t, 3>;

Offset OffsetOf(const display::FootprintEntry& e) { return {e.x, e.y, e.z}; }

Offset Greatest(const display::FootprintLists& lists) {
  Offset most = {0, 0, 0};
  for (const display::FootprintEntry& e : lists.entries) {
    for (size_t a = 0; a < 3; ++a) most[a] = std::max(most[a], OffsetOf(e)[a]);
  }
  return most;
}

}  // namespace

int Sampler::FastestAxis(const display::FootprintTable& table) {
  const Offset reach = Greatest(table.inner);
  return static_cast<int>(std::max_element(reach.begin(), reach.end()) - reach.begin());
}

absl::StatusOr<Sampler> Sampler::Create(display::FootprintTable table, const TileGrid& grid,
                                        display::Sampling sampling) {
  const Offset outer = Greatest(table.outer), inner = Greatest(table.inner);
  for (size_t a = 0; a < 3; ++a) {
    if (outer[a] + inner[a] >= grid.voxels[a]) {
      return absl::InternalError(absl::StrCat("footprints reach voxel ", outer[a] + inner[a],
                                              " on axis ", a, " of a grid of ", grid.voxels[a]));
    }
  }
  Sampler sampler;
  sampler.table_ = std::move(table);
  sampler.grid_ = grid;
  sampler.sampling_ = sampling;
  sampler.BuildInner();
  sampler.FindPlanes(grid);
  sampler.FindStrips(grid);
  return sampler;
}

void Sampler::BuildInner() {
  std::map<Offset, uint32_t> places;
  for (const display::FootprintEntry& e : table_.inner.entries) places[OffsetOf(e)] = 0;
  Offset last{};
  for (auto& [offset, place] : places) {
    place = static_cast<uint32_t>(places_++);
    if (!runs_.empty()) {
      Run& run = runs_.back();
      int axis = -1;  // the axis along which this voxel follows the last one
      for (int a = 0; a < 3; ++a) {
        Offset next = last;
        ++next[static_cast<size_t>(a)];
        if (next == offset) axis = a;
      }
      if (axis >= 0 && (run.length == 1 || run.axis == axis)) {
        run.axis = axis;
        ++run.length;
        last = offset;
        continue;
      }
    }
    runs_.push_back({{offset[0], offset[1], offset[2]}, 0, 1, place});
    last = offset;
  }
  for (const display::FootprintEntry& e : table_.inner.entries) {
    inner_.push_back({places[OffsetOf(e)], e.weight});
  }
  const uint32_t height = static_cast<uint32_t>(table_.height);
  single_ = runs_.size() == 1 && runs_[0].length == table_.height;
  for (int32_t set = 0; set < table_.inner_sets; ++set) {
    for (uint32_t v = 0; v < height; ++v) {
      const std::span<const InnerEntry> inner = Inner(set, v);
      single_ = single_ && inner.size() == 1 && inner[0].place == v;
    }
  }
  for (size_t row = 1; row < table_.outer.begin.size(); ++row) {
    single_ = single_ && table_.outer.begin[row] - table_.outer.begin[row - 1] <= 1;
  }
}

// Tiles are stored along y first, so the information about their rows tells which columns are lit.
void Sampler::FindPlanes(const TileGrid& grid) {
  if (!single_ || runs_[0].axis != 1 || grid.shift[1] != 0 || grid.shift[0] != kTileBits ||
      table_.width > grid.voxels[0]) {
    return;
  }
  std::vector<int32_t> planes;
  for (int32_t slice = 0; slice < table_.slices; ++slice) {
    for (int32_t u = 0; u < table_.width; ++u) {
      const auto outer = table_.Outer(slice, u);
      if (outer.size() != 1 || outer[0].x != u || outer[0].y != 0) return;
      if (u > 0 && outer[0].z != planes.back()) return;
      if (u == 0) planes.push_back(outer[0].z);
    }
  }
  const int32_t(&at)[3] = runs_[0].at;
  if (at[0] == 0 && at[2] == 0) plane_of_ = std::move(planes);
}

void Sampler::FindStrips(const TileGrid& grid) {
  if (!single_ || table_.height != 1) return;
  const int32_t(&at)[3] = runs_[0].at;
  strip_begin_.push_back(0);
  for (int32_t slice = 0; slice < table_.slices; ++slice) {
    for (int32_t u = 0; u < table_.width; ++u) {
      for (const display::FootprintEntry& e : table_.Outer(slice, u)) {
        const int32_t x = at[0] + e.x, y = at[1] + e.y, z = at[2] + e.z;
        const Strip one = {static_cast<uint32_t>(u), 1, grid.TileOf(x, y, z),
                           grid.IndexInTile(x, y, z)};
        const bool first = strips_.size() == strip_begin_.back();
        Strip* const last = first ? nullptr : &strips_.back();
        if (last != nullptr && last->tile == one.tile && last->u + last->count == one.u &&
            last->index + last->count == one.index && last->count < kTileSize) {
          ++last->count;
        } else {
          strips_.push_back(one);
        }
      }
    }
    strip_begin_.push_back(static_cast<uint32_t>(strips_.size()));
  }
}

// Returns row (slice, v), in the order of table_.inner.
std::span<const Sampler::InnerEntry> Sampler::Inner(int32_t slice, uint32_t v) const {
  const size_t row =
      static_cast<size_t>(slice % table_.inner_sets) * static_cast<size_t>(table_.height) + v;
  const uint32_t begin = table_.inner.begin[row];
  return std::span(inner_).subspan(begin, table_.inner.begin[row + 1] - begin);
}

// Raises line[place] to the colours of the voxels outer + inner; returns false if none is lit.
bool Sampler::Gather(const TileStore& tiles, const display::FootprintEntry& outer,
                     uint32_t* line) const {
  const TileGrid& grid = tiles.grid();
  uint32_t seen = 0;
  for (const Run& run : runs_) {
    int32_t at[3] = {run.at[0] + outer.x, run.at[1] + outer.y, run.at[2] + outer.z};
    const uint32_t shift = grid.shift[run.axis];
    uint32_t* to = line + run.place;
    for (int32_t left = run.length; left > 0;) {
      const int32_t count = std::min(left, kTileSize - at[run.axis] % kTileSize);
      if (const uint32_t* colors = tiles.colors(grid.TileOf(at[0], at[1], at[2]))) {
        const uint32_t* from = colors + grid.IndexInTile(at[0], at[1], at[2]);
        for (int32_t i = 0; i < count; ++i) {
          const uint32_t c = from[static_cast<uint32_t>(i) << shift];
          to[i] = std::max(to[i], c);
          seen |= c;
        }
      }
      at[run.axis] += count;
      to += count;
      left -= count;
    }
  }
  return seen != 0;
}

// Samples kColumns columns from u0 on, or as many as exist. The maximum over a product of lists is
// the maximum, over the inner list, of the maximum over the outer.
void Sampler::SampleMax(const TileStore& tiles, int32_t slice, uint32_t u0,
                        SlicePixels& out) const {
  const uint32_t width = static_cast<uint32_t>(table_.width);
  const uint32_t columns = std::min(kColumns, width - u0);
  uint32_t* const lines = out.lines.data();
  uint32_t lit[kColumns], lit_count = 0;  // columns that have any light
  for (uint32_t j = 0; j < columns; ++j) {
    uint32_t* const line = lines + j * places_;
    std::fill(line, line + places_, 0);
    bool any = false;
    for (const display::FootprintEntry& outer : table_.Outer(slice, static_cast<int32_t>(u0 + j))) {
      any |= Gather(tiles, outer, line);
    }
    if (any) lit[lit_count++] = j;
  }
  if (lit_count == 0) return;
  for (uint32_t v = 0; v < static_cast<uint32_t>(table_.height); ++v) {
    const std::span<const InnerEntry> inner = Inner(slice, v);
    for (uint32_t n = 0; n < lit_count; ++n) {
      const uint32_t* line = lines + lit[n] * places_;
      uint32_t greatest = 0;
      for (const InnerEntry& e : inner) greatest = std::max(greatest, line[e.place]);
      if (greatest == 0) continue;
      out.lit.push_back({Deinterleave(greatest), u0 + lit[n], v});
    }
  }
}

// The same as SampleMax, if single_ is true.
void Sampler::SampleSingle(const TileStore& tiles, int32_t slice, SlicePixels& out) const {
  const TileGrid& grid = tiles.grid();
  const Run& run = runs_[0];
  const uint32_t width = static_cast<uint32_t>(table_.width), shift = grid.shift[run.axis];
  for (uint32_t u = 0; u < width; ++u) {
    for (const display::FootprintEntry& outer : table_.Outer(slice, static_cast<int32_t>(u))) {
      int32_t at[3] = {run.at[0] + outer.x, run.at[1] + outer.y, run.at[2] + outer.z};
      for (int32_t v = 0; v < run.length;) {
        const int32_t count = std::min(run.length - v, kTileSize - at[run.axis] % kTileSize);
        const uint32_t* colors = tiles.colors(grid.TileOf(at[0], at[1], at[2]));
        if (colors != nullptr) {
          const uint32_t* from = colors + grid.IndexInTile(at[0], at[1], at[2]);
          for (uint32_t lit = LitBits(from, count, shift); lit != 0; lit &= lit - 1) {
            const int i = std::countr_zero(lit);
            out.lit.push_back({Deinterleave(from[static_cast<uint32_t>(i) << shift]), u,
                               static_cast<uint32_t>(v + i)});
          }
        }
        at[run.axis] += count;
        v += count;
      }
    }
  }
}

// The same as SampleSingle, if slices are rows.
void Sampler::SampleStrips(const TileStore& tiles, int32_t slice, SlicePixels& out) const {
  const size_t s = static_cast<size_t>(slice);
  for (uint32_t n = strip_begin_[s]; n < strip_begin_[s + 1]; ++n) {
    const Strip& strip = strips_[n];
    const uint32_t* const colors = tiles.colors(strip.tile);
    if (colors == nullptr) continue;
    const uint32_t* const from = colors + strip.index;
    for (uint32_t lit = LitBits(from, static_cast<int32_t>(strip.count), 0); lit != 0;
         lit &= lit - 1) {
      const uint32_t i = static_cast<uint32_t>(std::countr_zero(lit));
      out.lit.push_back({Deinterleave(from[i]), strip.u + i, 0});
    }
  }
}

// The same as SampleSingle, if slices are planes: goes tile by tile, and only through the lit rows
// of each.
void Sampler::SamplePlane(const TileStore& tiles, int32_t z, SlicePixels& out) const {
  const TileGrid& grid = tiles.grid();
  const int32_t first = runs_[0].at[1], last = first + runs_[0].length;  // of y
  struct Row {
    const uint32_t* from;
    uint32_t u, v;
    int32_t count;
  };
  // Prefetches several rows from memory before the first of them is used.
  constexpr size_t kTogether = 64;
  Row rows[kTogether];
  size_t count = 0;
  const auto look = [&] {
    for (const Row& row : std::span(rows, count)) {
      for (uint32_t lit = LitBits(row.from, row.count, 0); lit != 0; lit &= lit - 1) {
        const uint32_t bit = static_cast<uint32_t>(std::countr_zero(lit));
        out.lit.push_back({Deinterleave(row.from[bit]), row.u, row.v + bit});
      }
    }
    count = 0;
  };
  const uint32_t plane = static_cast<uint32_t>(z % kTileSize);  // of a tile: sixteen rows, by x
  for (int32_t j = first / kTileSize; j * kTileSize < last; ++j) {
    const int32_t y0 = std::max(first, j * kTileSize);
    const int32_t length = std::min(last, (j + 1) * kTileSize) - y0;
    for (int32_t i = 0; i * kTileSize < table_.width; ++i) {
      const uint32_t tile = grid.Index(i, j, z / kTileSize);
      const uint32_t* const colors = tiles.colors(tile);
      if (colors == nullptr) continue;
      uint32_t lit = tiles.rows(tile).bits[plane / 4] >> plane % 4 * 16 & 0xFFFF;
      const int32_t left = table_.width - i * kTileSize;
      if (left < kTileSize) lit &= (1u << left) - 1;
      for (; lit != 0; lit &= lit - 1) {
        const int32_t x = i * kTileSize + std::countr_zero(lit);
        const uint32_t* const from = colors + grid.IndexInTile(x, y0, z);
        __builtin_prefetch(from);
        rows[count++] = {from, static_cast<uint32_t>(x), static_cast<uint32_t>(y0 - first), length};
        if (count == kTogether) look();
      }
    }
  }
  look();
}

void Sampler::SampleWeighted(const TileStore& tiles, int32_t slice, uint32_t u,
                             SlicePixels& out) const {
  bool any = false;
  for (const display::FootprintEntry& outer : table_.Outer(slice, static_cast<int32_t>(u))) {
    std::fill(out.lines.begin(), out.lines.end(), 0);
    if (!Gather(tiles, outer, out.lines.data())) continue;
    if (!any) out.column.assign(static_cast<size_t>(table_.height), 0);
    any = true;
    for (uint32_t v = 0; v < static_cast<uint32_t>(table_.height); ++v) {
      uint32_t& rgb = out.column[v];
      for (const InnerEntry& inner : Inner(slice, v)) {
        const uint32_t color = out.lines[inner.place];
        if (color == 0) continue;
        rgb = RaiseWeighted(rgb, FootprintWeight(outer.weight, inner.weight), Deinterleave(color));
      }
    }
  }
  for (uint32_t v = 0; any && v < static_cast<uint32_t>(table_.height); ++v) {
    if (out.column[v] != 0) out.lit.push_back({out.column[v], u, v});
  }
}

void Sampler::Sample(const TileStore& tiles, int32_t slice, SlicePixels& out) const {
  const uint32_t width = static_cast<uint32_t>(table_.width);
  if (sampling_ == display::Sampling::kWeighted) {
    out.lines.resize(places_);
    for (uint32_t u = 0; u < width; ++u) SampleWeighted(tiles, slice, u, out);
  } else if (!plane_of_.empty()) {
    SamplePlane(tiles, plane_of_[static_cast<size_t>(slice)], out);
  } else if (!strip_begin_.empty()) {
    SampleStrips(tiles, slice, out);
  } else if (single_) {
    SampleSingle(tiles, slice, out);
  } else {
    out.lines.resize(places_ * kColumns);
    for (uint32_t u = 0; u < width; u += kColumns) SampleMax(tiles, slice, u, out);
  }
  if (table_.flat_row == 0) return;
  const auto row = static_cast<uint32_t>(table_.flat_row);
  for (SlicePixels::Pixel& pixel : out.lit) {
    pixel.v = pixel.u / row;
    pixel.u %= row;
  }
}

}  // namespace voxeld::gpu
