// Approximates true colours with those of a palette.
#pragma once

#include <vector>

#include "absl/container/flat_hash_map.h"
#include "tools/voxelctl/render/palette.h"

namespace voxeld::voxelctl {

// Applies an ordered dither. If a colour is not in the palette, a pixel gets either the nearest
// palette colour or the one on the other side of it, by a fixed pattern of 8·8 thresholds. Each is
// used as often as brings their mean nearest. Pixels that do not change between pictures keep their
// colours. Not thread-safe.
class OrderedDither {
 public:
  // Requires: 1 to 256 colours.
  explicit OrderedDither(std::vector<Color8> palette) : palette_(std::move(palette)) {}

  // Returns the palette index of each pixel.
  std::vector<uint8_t> Apply(const Image& image);

 private:
  struct Mix {
    uint8_t near = 0, far = 0;
    uint8_t share = 0;  // share of `far`, in 1/64
  };
  uint8_t Nearest(const std::array<int, 3>& color) const;
  Mix MixOf(const Color8& color) const;

  const std::vector<Color8> palette_;
  absl::flat_hash_map<uint32_t, Mix> mixes_;  // each computed once
};

}  // namespace voxeld::voxelctl
