#include "gpu/slice/sampler.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
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

void SlicePixels::Clear(size_t pixels) {
  if (rgb.size() != pixels) {
    rgb.assign(pixels, 0);
  } else {
    for (uint32_t i : lit) rgb[i] = 0;
  }
  lit.clear();
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
  sampler.sampling_ = sampling;
  sampler.BuildInner();
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
      int axis = -1;  // along which this voxel follows the last
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
}

// Raises line[place] to the colours of the voxels outer + inner; false if none is lit.
bool Sampler::Gather(const TileStore& tiles, const display::FootprintEntry& outer,
                     uint32_t* line) const {
  constexpr uint32_t kStride[3] = {1, kTileSize, kTileSize * kTileSize};
  const TileGrid& grid = tiles.grid();
  bool any = false;
  for (const Run& run : runs_) {
    int32_t at[3] = {run.at[0] + outer.x, run.at[1] + outer.y, run.at[2] + outer.z};
    const uint32_t stride = kStride[run.axis];
    uint32_t* to = line + run.place;
    for (int32_t left = run.length; left > 0;) {
      const int32_t count = std::min(left, kTileSize - at[run.axis] % kTileSize);
      const uint32_t* colors =
          tiles.colors(grid.Index(at[0] / kTileSize, at[1] / kTileSize, at[2] / kTileSize));
      if (colors != nullptr) {
        const uint32_t* from = colors + IndexInTile(at[0], at[1], at[2]);
        uint32_t seen = 0;
        for (int32_t i = 0; i < count; ++i) {
          const uint32_t c = from[static_cast<uint32_t>(i) * stride];
          to[i] = std::max(to[i], c);
          seen |= c;
        }
        any |= seen != 0;
      }
      at[run.axis] += count;
      to += count;
      left -= count;
    }
  }
  return any;
}

// The greatest of a product of lists is the greatest, over the inner list, of the greatest over the
// outer.
void Sampler::SampleMax(const TileStore& tiles, int32_t slice, uint32_t u, SlicePixels& out) const {
  const uint32_t width = static_cast<uint32_t>(table_.width);
  bool any = false;
  std::fill(out.line.begin(), out.line.end(), 0);
  for (const display::FootprintEntry& outer :
       table_.outer.list(static_cast<size_t>(slice) * width + u)) {
    any |= Gather(tiles, outer, out.line.data());
  }
  if (!any) return;
  for (uint32_t v = 0; v < static_cast<uint32_t>(table_.height); ++v) {
    uint32_t greatest = 0;
    for (uint32_t i = table_.inner.begin[v]; i < table_.inner.begin[v + 1]; ++i) {
      greatest = std::max(greatest, out.line[inner_[i].place]);
    }
    if (greatest == 0) continue;
    out.rgb[v * width + u] = Deinterleave(greatest);
    out.lit.push_back(v * width + u);
  }
}

void Sampler::SampleWeighted(const TileStore& tiles, int32_t slice, uint32_t u,
                             SlicePixels& out) const {
  const uint32_t width = static_cast<uint32_t>(table_.width);
  for (const display::FootprintEntry& outer :
       table_.outer.list(static_cast<size_t>(slice) * width + u)) {
    std::fill(out.line.begin(), out.line.end(), 0);
    if (!Gather(tiles, outer, out.line.data())) continue;
    for (uint32_t v = 0; v < static_cast<uint32_t>(table_.height); ++v) {
      uint32_t& rgb = out.rgb[v * width + u];
      const uint32_t before = rgb;
      for (uint32_t i = table_.inner.begin[v]; i < table_.inner.begin[v + 1]; ++i) {
        const uint32_t color = out.line[inner_[i].place];
        if (color == 0) continue;
        rgb = RaiseWeighted(rgb, FootprintWeight(outer.weight, inner_[i].weight),
                            Deinterleave(color));
      }
      if (before == 0 && rgb != 0) out.lit.push_back(v * width + u);
    }
  }
}

void Sampler::Sample(const TileStore& tiles, int32_t slice, SlicePixels& out) const {
  out.line.resize(places_);
  for (uint32_t u = 0; u < static_cast<uint32_t>(table_.width); ++u) {
    if (sampling_ == display::Sampling::kWeighted) {
      SampleWeighted(tiles, slice, u, out);
    } else {
      SampleMax(tiles, slice, u, out);
    }
  }
}

}  // namespace voxeld::gpu
