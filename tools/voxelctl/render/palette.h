// Pictures with few colours, which need little disk space.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

using Color8 = std::array<uint8_t, 3>;

struct PaletteImage {
  int width = 0, height = 0;
  std::vector<Color8> colors;    // at most 256
  std::vector<uint8_t> indices;  // per pixel, in an Image's order
};

// Counts how often each colour occurs in all added pictures. Not thread-safe.
class ColorCount {
 public:
  void Add(const Color8& color) { ++pixels_[Key(color)]; }
  void Add(const Image& image);

  // Returns means of similar colours (median cut: Heckbert, "Color image quantization for frame
  // buffer display", 1982), at most `most` (1 to 256); the colours themselves if there are no more
  // than that.
  std::vector<Color8> Cut(int most) const;
  // Does the same, and stores in `places` the palette index of each colour.
  std::vector<Color8> Cut(int most, absl::flat_hash_map<uint32_t, uint8_t>* places) const;

  static uint32_t Key(const Color8& c) {
    return static_cast<uint32_t>(c[0]) << 16 | static_cast<uint32_t>(c[1]) << 8 | c[2];
  }

 private:
  absl::flat_hash_map<uint32_t, uint64_t> pixels_;
};

// Reduces a picture to at most `most` colours, 1 to 256, as ColorCount selects them.
PaletteImage ReduceColors(const Image& image, int most);

}  // namespace voxeld::voxelctl
