// Locates the light of a display's pixels for drawing: each lit pixel of a slice becomes a point in
// a box with kPlaceSteps steps along each axis.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "display/api/geometry.h"
#include "display/geometry/corrector.h"

namespace voxeld::daemon::viewer {

inline constexpr uint16_t kPlaceSteps = 65534;

// Place q along an axis is low_mm + q / kPlaceSteps · (high_mm − low_mm).
struct PlaceBox {
  display::Vec3 low_mm, high_mm;
};

// Arrays of equal length; `rgb` is three times as long.
struct Points {
  std::vector<uint16_t> x, y, z;
  std::vector<uint8_t> rgb;
  size_t size() const { return x.size(); }
};

// Uses display::PixelPosition, which includes corrections. Where a slice's columns are straight,
// each column is looked up once. Elsewhere each pixel is looked up, and cached up to kKeptBytes.
// Not thread-safe.
class PixelPlaces {
 public:
  static constexpr size_t kKeptBytes = size_t{64} << 20;

  // Requires: `geometry` is valid.
  explicit PixelPlaces(display::Geometry geometry);

  // Returns: a box around the centres of all pixels. If a geometry has more than a few million
  // pixels and is not straight, the box is that of a sample, widened, and points outside are moved
  // to its faces.
  const PlaceBox& box() const { return box_; }
  // Returns: the smallest distance between neighbouring pixels of a slice, in mm; > 0.
  double pitch_mm() const { return pitch_mm_; }

  // Appends the pixels of `slice` that are not black, row by row. `rgb` has height · width · 3
  // bytes, row-major. Skips pixels without a light. Returns: the number of appended pixels.
  size_t Append(int32_t slice, std::span<const uint8_t> rgb, Points* out);
  // Returns: places of pixels, lit or not, in black: at most about kSample, evenly distributed over
  // slices and rows.
  static constexpr size_t kSample = 100'000;
  const Points& Sample();

  int32_t slices() const { return slices_; }
  int32_t width() const { return width_; }
  int32_t height() const { return height_; }

 private:
  struct Place {
    uint16_t x, y, z;
  };
  static constexpr Place kNone = {kPlaceSteps + 1, 0, 0};  // no light

  // Pixel v of a straight column is at base + v · step, in steps of the box.
  struct Column {
    float base[3], step[3];
  };

  display::Vec3 Position(int32_t slice, int32_t u, int32_t v) const;
  void FindBox();
  Place Quantise(const display::Vec3& mm) const;
  const Column* ColumnsOf(int32_t slice);
  const Place* PlacesOf(int32_t slice);

  const display::Geometry geometry_;
  const display::Corrector corrector_;
  const bool straight_;
  int32_t slices_ = 0, width_ = 0, height_ = 0;
  PlaceBox box_;
  double pitch_mm_ = 1;
  std::vector<std::vector<Column>> columns_;  // by slice; empty: not computed yet
  std::vector<std::vector<Place>> places_;
  std::vector<Place> unkept_;
  Points sample_;  // empty: not computed yet
  size_t kept_bytes_ = 0;
};

}  // namespace voxeld::daemon::viewer
