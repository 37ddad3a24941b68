#include "tools/voxelctl/render/palette.h"

#include <algorithm>

namespace voxeld::voxelctl {
namespace {

struct Counted {
  Color8 color;
  uint64_t pixels = 0;
};

// A range of the colours, and the channel in which they differ most.
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

// Returns the index that divides the group's pixels about in half, with at least one colour on
// either side. Requires: two or more colours.
size_t Middle(const std::vector<Counted>& colors, const Group& group) {
  uint64_t all = 0, before = 0;
  for (size_t i = group.begin; i < group.end; ++i) all += colors[i].pixels;
  size_t at = group.begin;
  do {
    before += colors[at++].pixels;
  } while (at + 1 < group.end && before * 2 < all);
  return at;
}

Color8 Mean(const std::vector<Counted>& colors, const Group& group) {
  uint64_t pixels = 0, sums[3] = {};
  for (size_t i = group.begin; i < group.end; ++i) {
    pixels += colors[i].pixels;
    for (size_t c = 0; c < 3; ++c) sums[c] += colors[i].pixels * colors[i].color[c];
  }
  pixels = std::max<uint64_t>(pixels, 1);
  Color8 mean;
  for (size_t c = 0; c < 3; ++c) mean[c] = static_cast<uint8_t>((sums[c] + pixels / 2) / pixels);
  return mean;
}

}  // namespace

void ColorCount::Add(const Image& image) {
  // Pictures consist mostly of runs of one colour.
  uint32_t last = 0;
  uint64_t* count = nullptr;
  for (size_t i = 0; i < image.rgb.size(); i += 3) {
    const uint32_t key = Key({image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]});
    if (count == nullptr || key != last) count = &pixels_[key];
    last = key;
    ++*count;
  }
}

std::vector<Color8> ColorCount::Cut(int most) const {
  absl::flat_hash_map<uint32_t, uint8_t> unused;
  return Cut(most, &unused);
}

std::vector<Color8> ColorCount::Cut(int most,
                                    absl::flat_hash_map<uint32_t, uint8_t>* places) const {
  std::vector<Counted> colors;
  colors.reserve(pixels_.size());
  for (const auto& [key, count] : pixels_) {
    colors.push_back({{static_cast<uint8_t>(key >> 16), static_cast<uint8_t>(key >> 8),
                       static_cast<uint8_t>(key)},
                      count});
  }
  std::sort(colors.begin(), colors.end(),
            [](const Counted& a, const Counted& b) { return a.color < b.color; });

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

  std::vector<Color8> out;
  for (const Group& group : groups) {
    for (size_t i = group.begin; i < group.end; ++i) {
      (*places)[Key(colors[i].color)] = static_cast<uint8_t>(out.size());
    }
    out.push_back(Mean(colors, group));
  }
  return out;
}

PaletteImage ReduceColors(const Image& image, int most) {
  ColorCount count;
  count.Add(image);
  absl::flat_hash_map<uint32_t, uint8_t> places;
  PaletteImage out{image.width, image.height, count.Cut(most, &places), {}};
  out.indices.reserve(image.rgb.size() / 3);
  for (size_t i = 0; i < image.rgb.size(); i += 3) {
    out.indices.push_back(
        places.at(ColorCount::Key({image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]})));
  }
  return out;
}

}  // namespace voxeld::voxelctl
