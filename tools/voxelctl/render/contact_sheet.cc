#include <algorithm>
#include <cmath>

#include "tools/voxelctl/render/render_volume.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kGap = 2;
constexpr int kMostPixels = 8192;
constexpr uint8_t kFrame[3] = {34, 38, 46};

// Columns for a sheet about as wide as 3 to 2.
int Columns(const Volume& volume, int cell_width, int cell_height) {
  const double columns = std::sqrt(1.5 * volume.slices * cell_height / cell_width);
  return std::clamp(static_cast<int>(std::lround(columns)), 1, volume.slices);
}

}  // namespace

Image ContactSheet(const Volume& volume) {
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

}  // namespace voxeld::voxelctl
