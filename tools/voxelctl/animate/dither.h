// True colours by those of a palette.
#pragma once

#include <vector>

#include "absl/container/flat_hash_map.h"
#include "tools/voxelctl/render/palette.h"

namespace voxeld::voxelctl {

// Where a colour is not of the palette, a pixel takes the nearest or the one on the other side of it, by a fixed
// pattern of 8·8 thresholds: each as often as brings their mean nearest. What does not change from picture to picture keeps
// its pixels. Not thread-safe.
class OrderedDither {
 public:
  // 1 to 256 colours.
  explicit OrderedDither(std::vector<Color8> palette) : palette_(std::move(palette)) {}

  // A place in the palette for each pixel.
  std::vector<uint8_t> Apply(const Image& image);

 private:
  struct Mix {
    uint8_t near = 0, far = 0;
    uint8_t share = 0;  // of `far`, in 1/64
  };
  uint8_t Nearest(const std::array<int, 3>& color) const;
  Mix MixOf(const Color8& color) const;

  const std::vector<Color8> palette_;
  absl::flat_hash_map<uint32_t, Mix> mixes_;  // found once
};

}  // namespace voxeld::voxelctl
