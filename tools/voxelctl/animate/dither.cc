#include "tools/voxelctl/animate/dither.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace voxeld::voxelctl {
namespace {

constexpr double kUnrest = 0.1;

// Returns an element of Bayer's matrix: 0 to 63, each once, neighbours far apart.
constexpr int Threshold(int x, int y) {
  int value = 0;
  for (int bit = 0; bit < 3; ++bit) {
    const int a = (x ^ y) >> bit & 1, b = y >> bit & 1;
    value |= (a << 1 | b) << (2 * (2 - bit));
  }
  return value;
}

}  // namespace

uint8_t OrderedDither::Nearest(const std::array<int, 3>& color) const {
  int least = std::numeric_limits<int>::max();
  size_t nearest = 0;
  for (size_t i = 0; i < palette_.size(); ++i) {
    int distance = 0;
    for (size_t c = 0; c < 3; ++c) {
      const int d = color[c] - palette_[i][c];
      distance += d * d;
    }
    if (distance >= least) continue;
    least = distance;
    nearest = i;
  }
  return static_cast<uint8_t>(nearest);
}

OrderedDither::Mix OrderedDither::MixOf(const Color8& color) const {
  const std::array<int, 3> wanted = {color[0], color[1], color[2]};
  Mix mix;
  mix.near = mix.far = Nearest(wanted);
  const Color8& near = palette_[mix.near];
  int64_t off = 0;
  for (size_t c = 0; c < 3; ++c) off += (wanted[c] - near[c]) * (wanted[c] - near[c]);
  double least = static_cast<double>(off);
  for (size_t i = 0; i < palette_.size() && off > 0; ++i) {
    int along = 0, length = 0;
    for (size_t c = 0; c < 3; ++c) {
      const int step = palette_[i][c] - near[c];
      along += (wanted[c] - near[c]) * step;
      length += step * step;
    }
    if (along <= 0) continue;
    const double share = std::min(1.0, static_cast<double>(along) / length);
    // The error of the mean, and with less weight the deviation of the pixels from it.
    const double cost = static_cast<double>(off) - 2 * share * along + share * share * length +
                        kUnrest * share * (1 - share) * length;
    if (cost >= least) continue;
    least = cost;
    mix.far = static_cast<uint8_t>(i);
    mix.share = static_cast<uint8_t>(std::lround(64 * share));
  }
  return mix;
}

std::vector<uint8_t> OrderedDither::Apply(const Image& image) {
  std::vector<uint8_t> out;
  out.reserve(image.rgb.size() / 3);
  uint32_t last = 0;
  Mix mix;
  bool any = false;
  const uint8_t* pixel = image.rgb.data();
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x, pixel += 3) {
      const Color8 color = {pixel[0], pixel[1], pixel[2]};
      const uint32_t key = ColorCount::Key(color);
      if (!any || key != last) {
        const auto [at, is_new] = mixes_.try_emplace(key);
        if (is_new) at->second = MixOf(color);
        mix = at->second;
        last = key;
        any = true;
      }
      out.push_back(Threshold(x & 7, y & 7) < mix.share ? mix.far : mix.near);
    }
  }
  return out;
}

}  // namespace voxeld::voxelctl
