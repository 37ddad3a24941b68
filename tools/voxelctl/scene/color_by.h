// Colours by a number that each point of a file has.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

struct ColorBy {
  std::string attribute;  // as the files call it, in any case; or x, y or z
  std::string colormap;   // empty: viridis
  std::optional<std::array<double, 2>>
      range;  // first less than second; none: from the least number to the greatest
};

// What the colours mean.
struct Legend {
  std::string attribute, colormap;
  double low = 0, high = 0;
  uint64_t without = 0;  // vertices that have no number; they are grey
};

// Colours every part that has the attribute by its values. They replace the part's own colours and texture, without
// shading. Numbers beyond the range have the colours of its ends. Call it before PlaceModels: x, y and z are as in the file.
// Errors: InvalidArgument if no part has such numbers, with the names of those there are, or if there is no such colour map.
absl::StatusOr<Legend> ApplyColorBy(const ColorBy& wanted, std::span<Model> models);

// "coloured by height: 0 to 12.5 (viridis); 3 without a number are grey".
std::string LegendText(const Legend& legend);

// `count` colours (red, green, blue) of the legend's map, from its low end to its high one.
std::vector<std::array<uint8_t, 3>> LegendColors(const Legend& legend, size_t count);

}  // namespace voxeld::voxelctl
