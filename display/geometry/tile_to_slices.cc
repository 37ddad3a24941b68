#include <algorithm>
#include <utility>

#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

int32_t Along(Axis axis, int32_t x, int32_t y, int32_t z) {
  return axis == Axis::kX ? x : axis == Axis::kY ? y : z;
}

// Returns true if inner lists add nothing, so that outer entries may lie along all axes.
bool InnerIsPoint(const FootprintTable& table) {
  return std::all_of(table.inner.entries.begin(), table.inner.entries.end(),
                     [](const FootprintEntry& e) { return e.x == 0 && e.y == 0 && e.z == 0; });
}

}  // namespace

TileToSlices::TileToSlices(const FootprintTable& table, const VoxelGrid& grid, int32_t tx,
                           int32_t ty, int32_t tz)
    : tiles_x_((grid.nx + tx - 1) / tx),
      tiles_y_((grid.ny + ty - 1) / ty),
      tiles_z_((grid.nz + tz - 1) / tz),
      inner_axis_(table.inner_axis),
      inner_sets_(table.inner_sets) {
  // Row-major, without the inner axis unless outer entries lie along it too.
  const bool whole = InnerIsPoint(table);
  const int32_t tiles[3] = {tiles_x_, tiles_y_, tiles_z_};
  size_t places = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const bool counts = whole || axis != static_cast<int>(inner_axis_);
    stride_[axis] = counts ? static_cast<int32_t>(places) : 0;
    if (counts) places *= static_cast<size_t>(tiles[axis]);
  }

  const size_t along = static_cast<size_t>(Along(inner_axis_, tiles_x_, tiles_y_, tiles_z_));
  inner_seen_.assign(static_cast<size_t>(inner_sets_) * along, 0);
  for (int32_t set = 0; set < inner_sets_; ++set) {
    uint8_t* const of_set = inner_seen_.data() + static_cast<size_t>(set) * along;
    for (int32_t v = 0; v < table.height; ++v) {
      for (const FootprintEntry& entry : table.Inner(set, v)) {
        if (whole) {
          std::fill_n(of_set, along, 1);
        } else {
          of_set[Along(inner_axis_, entry.x / tx, entry.y / ty, entry.z / tz)] = 1;
        }
      }
    }
  }

  // Slices are visited in ascending order, so a duplicate can only be the slice visited last.
  std::vector<int32_t> last(places, -1);
  std::vector<std::pair<size_t, int32_t>> seen;
  for (int32_t slice = 0; slice < table.slices; ++slice) {
    for (int32_t u = 0; u < table.width; ++u) {
      for (const FootprintEntry& entry : table.Outer(slice, u)) {
        const size_t place = PlaceOf(entry.x / tx, entry.y / ty, entry.z / tz).outer;
        if (std::exchange(last[place], slice) != slice) seen.emplace_back(place, slice);
      }
    }
  }
  begin_.assign(places + 1, 0);
  for (const auto& [place, slice] : seen) ++begin_[place + 1];
  for (size_t place = 0; place < places; ++place) begin_[place + 1] += begin_[place];
  std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
  slices_.resize(seen.size());
  for (const auto& [place, slice] : seen) slices_[next[place]++] = slice;
}

TileToSlices::Tables TileToSlices::tables() const {
  return {{stride_[0], stride_[1], stride_[2]},
          inner_axis_,
          inner_sets_,
          Along(inner_axis_, tiles_x_, tiles_y_, tiles_z_),
          begin_,
          slices_,
          inner_seen_};
}

TileToSlices::Place TileToSlices::PlaceOf(int32_t i, int32_t j, int32_t k) const {
  return {static_cast<size_t>(i) * static_cast<size_t>(stride_[0]) +
              static_cast<size_t>(j) * static_cast<size_t>(stride_[1]) +
              static_cast<size_t>(k) * static_cast<size_t>(stride_[2]),
          static_cast<size_t>(Along(inner_axis_, i, j, k))};
}

bool TileToSlices::SeenInner(int32_t slice, size_t inner) const {
  const size_t along = inner_seen_.size() / static_cast<size_t>(inner_sets_);
  return inner_seen_[static_cast<size_t>(slice % inner_sets_) * along + inner] != 0;
}

std::span<const int32_t> TileToSlices::OuterSlices(size_t outer) const {
  return std::span(slices_).subspan(begin_[outer], begin_[outer + 1] - begin_[outer]);
}

std::vector<int32_t> TileToSlices::Slices(int32_t i, int32_t j, int32_t k) const {
  const Place place = PlaceOf(i, j, k);
  std::vector<int32_t> slices;
  for (const int32_t slice : OuterSlices(place.outer)) {
    if (SeenInner(slice, place.inner)) slices.push_back(slice);
  }
  return slices;
}

bool TileToSlices::Visible(int32_t i, int32_t j, int32_t k, int32_t begin, int32_t end) const {
  const Place place = PlaceOf(i, j, k);
  const std::span<const int32_t> slices = OuterSlices(place.outer);
  for (auto s = std::lower_bound(slices.begin(), slices.end(), begin);
       s != slices.end() && *s < end; ++s) {
    if (SeenInner(*s, place.inner)) return true;
  }
  return false;
}

}  // namespace voxeld::display
