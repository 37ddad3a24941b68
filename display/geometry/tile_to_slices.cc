#include <algorithm>
#include <utility>

#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

// Without the inner axis; a plane of tiles in row-major order.
struct OuterPlane {
  int32_t stride_x, stride_y, stride_z;
};

OuterPlane PlaneOf(Axis inner, int32_t tiles_x, int32_t tiles_y) {
  switch (inner) {
    case Axis::kX:
      return {0, 1, tiles_y};
    case Axis::kY:
      return {1, 0, tiles_x};
    case Axis::kZ:
      break;
  }
  return {1, tiles_x, 0};
}

int32_t Along(Axis axis, int32_t x, int32_t y, int32_t z) {
  return axis == Axis::kX ? x : axis == Axis::kY ? y : z;
}

}  // namespace

TileToSlices::TileToSlices(const FootprintTable& table, const VoxelGrid& grid, int32_t tx,
                           int32_t ty, int32_t tz)
    : tiles_x_((grid.nx + tx - 1) / tx),
      tiles_y_((grid.ny + ty - 1) / ty),
      tiles_z_((grid.nz + tz - 1) / tz),
      inner_axis_(table.inner_axis),
      inner_sets_(table.inner_sets) {
  const size_t along = static_cast<size_t>(Along(inner_axis_, tiles_x_, tiles_y_, tiles_z_));
  inner_seen_.assign(static_cast<size_t>(inner_sets_) * along, 0);
  for (int32_t set = 0; set < inner_sets_; ++set) {
    for (int32_t v = 0; v < table.height; ++v) {
      for (const FootprintEntry& entry : table.Inner(set, v)) {
        const Place place = PlaceOf(entry.x / tx, entry.y / ty, entry.z / tz);
        inner_seen_[static_cast<size_t>(set) * along + place.inner] = 1;
      }
    }
  }

  // Slices ascend as they are visited, so a repetition is one of the slice visited last.
  const size_t places = static_cast<size_t>(tiles_x_) * static_cast<size_t>(tiles_y_) *
                        static_cast<size_t>(tiles_z_) / along;
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
  const OuterPlane plane = PlaneOf(inner_axis_, tiles_x_, tiles_y_);
  return {{plane.stride_x, plane.stride_y, plane.stride_z},
          inner_axis_,
          inner_sets_,
          Along(inner_axis_, tiles_x_, tiles_y_, tiles_z_),
          begin_,
          slices_,
          inner_seen_};
}

TileToSlices::Place TileToSlices::PlaceOf(int32_t i, int32_t j, int32_t k) const {
  const OuterPlane plane = PlaneOf(inner_axis_, tiles_x_, tiles_y_);
  return {static_cast<size_t>(i) * static_cast<size_t>(plane.stride_x) +
              static_cast<size_t>(j) * static_cast<size_t>(plane.stride_y) +
              static_cast<size_t>(k) * static_cast<size_t>(plane.stride_z),
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
