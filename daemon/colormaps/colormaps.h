// Colour maps by name (proto/voxeld/v1/colormaps.txt).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld {

using ColorTable = std::array<uint32_t, 256>;  // 0x00RRGGBB, of 0 to 1

// None if there is no such map. With "_r" behind its name each is turned round.
std::optional<ColorTable> FindColormap(std::string_view name);
// As they stand in the file, without those turned round.
std::vector<std::string> ColormapNames();
// What to say of a name that is none: the one that may be meant, or which there are.
std::string ColormapAdvice(std::string_view wrong);

}  // namespace voxeld
