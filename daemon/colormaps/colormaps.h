// Finds colour maps by name (proto/voxeld/v1/colormaps.txt).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld {

using ColorTable = std::array<uint32_t, 256>;  // 0x00RRGGBB for values from 0 to 1

// Returns: nothing if the map does not exist. The suffix "_r" reverses a map.
std::optional<ColorTable> FindColormap(std::string_view name);
// Returns: the names in the order of the file, without reversed maps.
std::vector<std::string> ColormapNames();
// Returns: advice for an unknown name: a similar name, or the list of all names.
std::string ColormapAdvice(std::string_view wrong);

}  // namespace voxeld
