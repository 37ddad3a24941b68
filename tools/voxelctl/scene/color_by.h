// Colours by a numeric attribute of each point of a file.
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
  std::string attribute;  // its name in the files, case-insensitive; or x, y or z
  std::string colormap;   // empty: viridis
  std::optional<std::array<double, 2>>
      range;  // ascending; none: from the least value to the greatest
};

// The meaning of the colours.
struct Legend {
  std::string attribute, colormap;
  double low = 0, high = 0;
  uint64_t without = 0;  // vertices without a value, which are grey
};

// Colours every part that has the attribute by its values. These colours replace the part's own
// colours and texture, and are not shaded. Values beyond the range get the colours of its ends.
// Call it before PlaceModels: x, y and z are as in the file. Errors: InvalidArgument if no part has
// such values, with the existing names, or if the colour map does not exist.
absl::StatusOr<Legend> ApplyColorBy(const ColorBy& wanted, std::span<Model> models);

// Returns "coloured by height: 0 to 12.5 (viridis); 3 without a number are grey".
std::string LegendText(const Legend& legend);

// Returns `count` colours (red, green, blue) of the legend's map, from its low end to its high one.
std::vector<std::array<uint8_t, 3>> LegendColors(const Legend& legend, size_t count);

}  // namespace voxeld::voxelctl
