#include "daemon/viewer/pixel_places.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <variant>

#include "display/geometry/flat_footprints.h"
#include "display/geometry/footprint.h"

namespace voxeld::daemon::viewer {
namespace {

using display::Vec3;

constexpr double kSteps = kPlaceSteps;
constexpr int64_t kMostLookedAt = 4'000'000;
constexpr double kWidened = 0.02;  // of the extent, if only a sample was examined

bool IsStraight(const display::Geometry& geometry) {
  return !display::IsFlat(geometry) && !std::holds_alternative<display::Lattice>(geometry.shape);
}

double Distance(const Vec3& a, const Vec3& b) {
  return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) +
                   (a.z - b.z) * (a.z - b.z));
}

// Returns: the index of the next byte that is not 0, from `at` on; `end` if all are 0.
size_t NextLit(std::span<const uint8_t> bytes, size_t at) {
  while (at + 8 <= bytes.size()) {
    uint64_t eight;
    std::memcpy(&eight, bytes.data() + at, 8);
    if (eight != 0) break;
    at += 8;
  }
  while (at < bytes.size() && bytes[at] == 0) ++at;
  return at;
}

uint16_t Step(float value) {
  constexpr float kHalf = 0.5f;  // rounds to nearest: places are not negative
  return static_cast<uint16_t>(std::clamp(value, 0.0f, static_cast<float>(kSteps)) + kHalf);
}

}  // namespace

PixelPlaces::PixelPlaces(display::Geometry geometry)
    : geometry_(std::move(geometry)),
      corrector_(geometry_.correction),
      straight_(IsStraight(geometry_)) {
  slices_ = display::SliceCount(geometry_);
  std::tie(width_, height_) =
      std::visit([](const auto& shape) { return std::pair(shape.width_px, shape.height_px); },
                 geometry_.shape);
  columns_.resize(straight_ ? static_cast<size_t>(slices_) : 0);
  places_.resize(straight_ ? 0 : static_cast<size_t>(slices_));
  FindBox();
}

Vec3 PixelPlaces::Position(int32_t slice, int32_t u, int32_t v) const {
  return display::PixelPosition(geometry_, corrector_, slice, u, v);
}

void PixelPlaces::FindBox() {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Vec3 low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};
  double pitch = kFar;
  const int64_t rows = straight_ ? std::min(height_, 2) : height_;
  const int64_t all = int64_t{slices_} * width_ * rows;
  const int64_t stride = (all + kMostLookedAt - 1) / kMostLookedAt;
  for (int64_t i = 0; i < all; i += stride) {
    const auto slice = static_cast<int32_t>(i / (width_ * rows));
    const auto row = static_cast<int32_t>(i / width_ % rows);
    const auto u = static_cast<int32_t>(i % width_);
    const int32_t v = straight_ && row == 1 ? height_ - 1 : row;
    const Vec3 at = Position(slice, u, v);
    if (std::isnan(at.x)) continue;
    low = {std::min(low.x, at.x), std::min(low.y, at.y), std::min(low.z, at.z)};
    high = {std::max(high.x, at.x), std::max(high.y, at.y), std::max(high.z, at.z)};
    for (const auto& [du, dv] : {std::pair(1, 0), std::pair(0, 1)}) {
      if (u + du >= width_ || v + dv >= height_) continue;
      const double step = Distance(at, Position(slice, u + du, v + dv));
      if (step > 0) pitch = std::min(pitch, step);
    }
  }
  if (!(low.x <= high.x)) low = high = {};  // a lattice without lights
  if (stride > 1) {
    const double more = kWidened * Distance(low, high);
    low = {low.x - more, low.y - more, low.z - more};
    high = {high.x + more, high.y + more, high.z + more};
  }
  const display::Vec3& cell = geometry_.grid.pitch_mm;
  pitch_mm_ = std::isfinite(pitch) ? pitch : std::min({cell.x, cell.y, cell.z});
  // A flat display needs an extent, too.
  const double least = pitch_mm_ / 2;
  for (auto [from, to] :
       {std::pair(&low.x, &high.x), std::pair(&low.y, &high.y), std::pair(&low.z, &high.z)}) {
    if (*to - *from >= least) continue;
    const double middle = (*from + *to) / 2;
    *from = middle - least, *to = middle + least;
  }
  box_ = {low, high};
}

PixelPlaces::Place PixelPlaces::Quantise(const Vec3& mm) const {
  if (std::isnan(mm.x)) return kNone;
  const auto step = [](double at, double low, double high) {
    return Step(static_cast<float>((at - low) * (kSteps / (high - low))));
  };
  return {step(mm.x, box_.low_mm.x, box_.high_mm.x), step(mm.y, box_.low_mm.y, box_.high_mm.y),
          step(mm.z, box_.low_mm.z, box_.high_mm.z)};
}

const PixelPlaces::Column* PixelPlaces::ColumnsOf(int32_t slice) {
  std::vector<Column>& columns = columns_[static_cast<size_t>(slice)];
  if (!columns.empty()) return columns.data();
  columns.resize(static_cast<size_t>(width_));
  const Vec3 extent = {box_.high_mm.x - box_.low_mm.x, box_.high_mm.y - box_.low_mm.y,
                       box_.high_mm.z - box_.low_mm.z};
  for (int32_t u = 0; u < width_; ++u) {
    const Vec3 base = Position(slice, u, 0);
    const Vec3 top = height_ > 1 ? Position(slice, u, height_ - 1) : base;
    const double rows = std::max(1, height_ - 1);
    const double from[3] = {base.x - box_.low_mm.x, base.y - box_.low_mm.y, base.z - box_.low_mm.z};
    const double way[3] = {top.x - base.x, top.y - base.y, top.z - base.z};
    const double sizes[3] = {extent.x, extent.y, extent.z};
    for (size_t axis = 0; axis < 3; ++axis) {
      const double scale = kSteps / sizes[axis];
      columns[static_cast<size_t>(u)].base[axis] = static_cast<float>(from[axis] * scale);
      columns[static_cast<size_t>(u)].step[axis] = static_cast<float>(way[axis] / rows * scale);
    }
  }
  return columns.data();
}

const PixelPlaces::Place* PixelPlaces::PlacesOf(int32_t slice) {
  std::vector<Place>& kept = places_[static_cast<size_t>(slice)];
  if (!kept.empty()) return kept.data();
  const size_t pixels = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  const bool keep = kept_bytes_ + pixels * sizeof(Place) <= kKeptBytes;
  std::vector<Place>& places = keep ? kept : unkept_;
  places.resize(pixels);
  for (int32_t v = 0; v < height_; ++v) {
    for (int32_t u = 0; u < width_; ++u) {
      places[static_cast<size_t>(v) * static_cast<size_t>(width_) + static_cast<size_t>(u)] =
          Quantise(Position(slice, u, v));
    }
  }
  if (keep) kept_bytes_ += pixels * sizeof(Place);
  return places.data();
}

size_t PixelPlaces::Append(int32_t slice, std::span<const uint8_t> rgb, Points* out) {
  const size_t before = out->size();
  const Column* const columns = straight_ ? ColumnsOf(slice) : nullptr;
  const Place* const places = straight_ ? nullptr : PlacesOf(slice);
  const auto width = static_cast<size_t>(width_);
  for (size_t byte = NextLit(rgb, 0); byte < rgb.size();) {
    const size_t pixel = byte / 3;
    if (columns != nullptr) {
      const Column& column = columns[pixel % width];
      const size_t row = pixel / width;
      const auto v = static_cast<float>(row);
      out->x.push_back(Step(column.base[0] + v * column.step[0]));
      out->y.push_back(Step(column.base[1] + v * column.step[1]));
      out->z.push_back(Step(column.base[2] + v * column.step[2]));
      out->rgb.insert(out->rgb.end(), rgb.begin() + static_cast<std::ptrdiff_t>(pixel * 3),
                      rgb.begin() + static_cast<std::ptrdiff_t>(pixel * 3 + 3));
    } else if (places != nullptr && places[pixel].x != kNone.x) {
      const Place& place = places[pixel];
      out->x.push_back(place.x);
      out->y.push_back(place.y);
      out->z.push_back(place.z);
      out->rgb.insert(out->rgb.end(), rgb.begin() + static_cast<std::ptrdiff_t>(pixel * 3),
                      rgb.begin() + static_cast<std::ptrdiff_t>(pixel * 3 + 3));
    }
    byte = NextLit(rgb, pixel * 3 + 3);
  }
  return out->size() - before;
}

const Points& PixelPlaces::Sample() {
  if (sample_.size() > 0) return sample_;
  const size_t pixels = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  const size_t all = pixels * static_cast<size_t>(slices_);
  const size_t stride = std::max<size_t>(1, (all + kSample - 1) / kSample);
  for (size_t i = 0; i < all; i += stride) {
    const auto u = static_cast<int32_t>(i % static_cast<size_t>(width_));
    const auto v = static_cast<int32_t>(i % pixels / static_cast<size_t>(width_));
    const Vec3 mm = Position(static_cast<int32_t>(i / pixels), u, v);
    if (std::isnan(mm.x)) continue;
    const Place place = Quantise(mm);
    sample_.x.push_back(place.x);
    sample_.y.push_back(place.y);
    sample_.z.push_back(place.z);
    sample_.rgb.insert(sample_.rgb.end(), 3, 0);
  }
  return sample_;
}

}  // namespace voxeld::daemon::viewer
