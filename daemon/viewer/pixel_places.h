// Where the light of a display's pixels is, for those who draw it: each lit pixel of a slice as a point in a box of
// kPlaceSteps steps an axis.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "display/api/geometry.h"
#include "display/geometry/corrector.h"

namespace voxeld::daemon::viewer {

inline constexpr uint16_t kPlaceSteps = 65534;

// Place q of an axis is low_mm + q / kPlaceSteps · (high_mm − low_mm).
struct PlaceBox {
  display::Vec3 low_mm, high_mm;
};

// Arrays of one length; of `rgb` three times that.
struct Points {
  std::vector<uint16_t> x, y, z;
  std::vector<uint8_t> rgb;
  size_t size() const { return x.size(); }
};

// Places come from display::PixelPosition, so corrections are in them. Where a slice's columns are straight a column is
// looked up once; elsewhere pixels are, and kept while they fit kKeptBytes. Not thread-safe.
class PixelPlaces {
 public:
  static constexpr size_t kKeptBytes = size_t{64} << 20;

  // `geometry` is valid.
  explicit PixelPlaces(display::Geometry geometry);

  // Around the centres of all pixels; of geometries with more than a few million of them that are not straight, around
  // a sample, widened: what lies outside is put on its face.
  const PlaceBox& box() const { return box_; }
  // The least distance between neighbouring pixels of a slice, mm; > 0.
  double pitch_mm() const { return pitch_mm_; }

  // Appends the pixels of `slice` that are not black, row by row. `rgb`: height · width · 3 bytes, row-major. A pixel
  // without a light is passed over. Answers how many came.
  size_t Append(int32_t slice, std::span<const uint8_t> rgb, Points* out);
  // Where pixels are, lit or not, in black: about kSample at the most, evenly chosen through slices and rows.
  static constexpr size_t kSample = 100'000;
  const Points& Sample();

  int32_t slices() const { return slices_; }
  int32_t width() const { return width_; }
  int32_t height() const { return height_; }

 private:
  struct Place {
    uint16_t x, y, z;
  };
  static constexpr Place kNone = {kPlaceSteps + 1, 0, 0};  // there is no light

  // Pixel v of a straight column lies at base + v · step, in steps of the box.
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
  std::vector<std::vector<Column>> columns_;  // by slice; empty: not yet
  std::vector<std::vector<Place>> places_;
  std::vector<Place> unkept_;
  Points sample_;  // empty: not yet
  size_t kept_bytes_ = 0;
};

}  // namespace voxeld::daemon::viewer
