#include "tools/voxelctl/render/palette.h"

#include <algorithm>
#include <map>

namespace voxeld::voxelctl {
namespace {

using Color = std::array<uint8_t, 3>;

struct Counted {
  Color color;
  uint64_t pixels = 0;
};

// A run of the colours, and along which channel they differ most.
struct Group {
  size_t begin = 0, end = 0;
  int channel = 0, range = 0;

  static Group Of(const std::vector<Counted>& colors, size_t begin, size_t end) {
    Group group{begin, end};
    for (int c = 0; c < 3; ++c) {
      const size_t at = static_cast<size_t>(c);
      int least = 255, greatest = 0;
      for (size_t i = begin; i < end; ++i) {
        least = std::min<int>(least, colors[i].color[at]);
        greatest = std::max<int>(greatest, colors[i].color[at]);
      }
      if (greatest - least <= group.range) continue;
      group.channel = c;
      group.range = greatest - least;
    }
    return group;
  }
};

// Where about half of the group's pixels are on either side, and at least a colour: it has two or more.
size_t Middle(const std::vector<Counted>& colors, const Group& group) {
  uint64_t all = 0, before = 0;
  for (size_t i = group.begin; i < group.end; ++i) all += colors[i].pixels;
  size_t at = group.begin;
  do {
    before += colors[at++].pixels;
  } while (at + 1 < group.end && before * 2 < all);
  return at;
}

Color Mean(const std::vector<Counted>& colors, const Group& group) {
  uint64_t pixels = 0, sums[3] = {};
  for (size_t i = group.begin; i < group.end; ++i) {
    pixels += colors[i].pixels;
    for (size_t c = 0; c < 3; ++c) sums[c] += colors[i].pixels * colors[i].color[c];
  }
  pixels = std::max<uint64_t>(pixels, 1);
  Color mean;
  for (size_t c = 0; c < 3; ++c) mean[c] = static_cast<uint8_t>((sums[c] + pixels / 2) / pixels);
  return mean;
}

}  // namespace

PaletteImage ReduceColors(const Image& image, int most) {
  std::map<Color, uint64_t> pixels;
  const auto color_at = [&](size_t i) {
    return Color{image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]};
  };
  for (size_t i = 0; i < image.rgb.size(); i += 3) ++pixels[color_at(i)];
  std::vector<Counted> colors;
  colors.reserve(pixels.size());
  for (const auto& [color, count] : pixels) colors.push_back({color, count});

  std::vector<Group> groups;
  if (!colors.empty()) groups.push_back(Group::Of(colors, 0, colors.size()));
  while (groups.size() < static_cast<size_t>(most)) {
    const auto widest =
        std::max_element(groups.begin(), groups.end(),
                         [](const Group& a, const Group& b) { return a.range < b.range; });
    if (widest == groups.end() || widest->range == 0) break;
    const Group group = *widest;
    const size_t channel = static_cast<size_t>(group.channel);
    std::stable_sort(colors.begin() + static_cast<ptrdiff_t>(group.begin),
                     colors.begin() + static_cast<ptrdiff_t>(group.end),
                     [channel](const Counted& a, const Counted& b) {
                       return a.color[channel] < b.color[channel];
                     });
    const size_t middle = Middle(colors, group);
    *widest = Group::Of(colors, group.begin, middle);
    groups.push_back(Group::Of(colors, middle, group.end));
  }

  PaletteImage out{image.width, image.height, {}, {}};
  std::map<Color, uint8_t> index_of;
  for (const Group& group : groups) {
    for (size_t i = group.begin; i < group.end; ++i) {
      index_of[colors[i].color] = static_cast<uint8_t>(out.colors.size());
    }
    out.colors.push_back(Mean(colors, group));
  }
  out.indices.reserve(image.rgb.size() / 3);
  for (size_t i = 0; i < image.rgb.size(); i += 3) out.indices.push_back(index_of[color_at(i)]);
  return out;
}

}  // namespace voxeld::voxelctl
