// The order in which lights take their colours.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace voxeld::display::network {

// Gives for each byte of a pixel its colour: red, green or blue (0, 1, 2).
using ColorOrder = std::array<size_t, 3>;

inline constexpr std::array<std::string_view, 6> kColorOrders = {"rgb", "rbg", "grb",
                                                                 "gbr", "brg", "bgr"};

constexpr ColorOrder ColorOrderOf(std::string_view text) {
  ColorOrder order{};
  for (size_t i = 0; i < 3; ++i) order[i] = text[i] == 'r' ? 0 : text[i] == 'g' ? 1 : 2;
  return order;
}

}  // namespace voxeld::display::network
