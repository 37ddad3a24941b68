// In which order lights take their colours.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace voxeld::display::network {

// Which of red, green and blue (0, 1, 2) each byte of a pixel is.
using ColorOrder = std::array<size_t, 3>;

inline constexpr std::array<std::string_view, 6> kColorOrders = {"rgb", "rbg", "grb",
                                                                 "gbr", "brg", "bgr"};

constexpr ColorOrder ColorOrderOf(std::string_view text) {
  ColorOrder order{};
  for (size_t i = 0; i < 3; ++i) order[i] = text[i] == 'r' ? 0 : text[i] == 'g' ? 1 : 2;
  return order;
}

}  // namespace voxeld::display::network
