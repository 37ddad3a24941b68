#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <variant>

#include "tools/voxelctl/render/render_volume.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kGap = 2;
constexpr int kMostPixels = 8192;
constexpr uint8_t kFrame[3] = {34, 38, 46};

// Returns the number of columns for a sheet of about 3 to 2.
int Columns(const Volume& volume, int cell_width, int cell_height) {
  const double columns = std::sqrt(1.5 * volume.slices * cell_height / cell_width);
  return std::clamp(static_cast<int>(std::lround(columns)), 1, volume.slices);
}

// Returns a lattice's slices as pictures that are about square, with square lights.
Volume Folded(const Volume& volume) {
  constexpr double kPixelsWanted = 1 << 20;
  const double lights = static_cast<double>(volume.slices) * volume.width;
  const int side = std::clamp(static_cast<int>(std::sqrt(kPixelsWanted / lights)), 1, 8);
  const int columns = static_cast<int>(std::ceil(std::sqrt(volume.width)));
  Volume folded;
  folded.slices = volume.slices;
  folded.width = columns * side;
  folded.height = (volume.width + columns - 1) / columns * side;
  folded.rgb.resize(folded.slice_bytes() * static_cast<size_t>(folded.slices));
  uint8_t* out = folded.rgb.data();
  for (int slice = 0; slice < folded.slices; ++slice) {
    for (int v = 0; v < folded.height; ++v) {
      for (int u = 0; u < folded.width; ++u, out += 3) {
        const int light = v / side * columns + u / side;
        if (light < volume.width) std::copy_n(volume.pixel(slice, light, 0), 3, out);
      }
    }
  }
  return folded;
}

Image SheetOf(const Volume& volume) {
  int shrink = 1, cell_width = 0, cell_height = 0, columns = 0, rows = 0;
  Image image;
  for (;; ++shrink) {
    cell_width = (volume.width + shrink - 1) / shrink + kGap;
    cell_height = (volume.height + shrink - 1) / shrink + kGap;
    columns = Columns(volume, cell_width, cell_height);
    rows = (volume.slices + columns - 1) / columns;
    image.width = columns * cell_width + kGap;
    image.height = rows * cell_height + kGap;
    if ((image.width <= kMostPixels && image.height <= kMostPixels) ||
        (cell_width <= 1 + kGap && cell_height <= 1 + kGap))
      break;
  }
  const auto row_bytes = static_cast<size_t>(image.width) * 3;
  image.rgb.resize(row_bytes * static_cast<size_t>(image.height));
  for (size_t i = 0; i < image.rgb.size(); ++i) image.rgb[i] = kFrame[i % 3];
  for (int slice = 0; slice < volume.slices; ++slice) {
    const int left = kGap + slice % columns * cell_width;
    const int bottom = kGap + slice / columns * cell_height + (cell_height - kGap) - 1;
    const auto at = [&](int u, int v) {
      return image.rgb.data() + static_cast<size_t>(bottom - v / shrink) * row_bytes +
             static_cast<size_t>(left + u / shrink) * 3;
    };
    for (int v = 0; v < volume.height; v += shrink) {
      for (int u = 0; u < volume.width; u += shrink) std::fill_n(at(u, v), 3, uint8_t{0});
    }
    for (int v = 0; v < volume.height; ++v) {
      for (int u = 0; u < volume.width; ++u) {
        const uint8_t* pixel = volume.pixel(slice, u, v);
        uint8_t* out = at(u, v);
        for (int c = 0; c < 3; ++c) out[c] = std::max(out[c], pixel[c]);
      }
    }
  }
  return image;
}

}  // namespace

Image ContactSheet(const Volume& volume) {
  const bool lattice = std::holds_alternative<display::Lattice>(volume.geometry.shape);
  return lattice ? SheetOf(Folded(volume)) : SheetOf(volume);
}

}  // namespace voxeld::voxelctl
