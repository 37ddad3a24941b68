// The colour table that the host sends to a board (docs/protocols/fadecandy.md §9).
#pragma once

#include <array>

#include "display/drivers/fadecandy/protocol.h"

namespace voxeld::display::fadecandy {

struct ColorCurve {
  double gamma = 2.5;                       // > 0
  std::array<double, 3> white = {1, 1, 1};  // for red, green, blue; 0 to 1 and a little above
  double slope = 1;                         // slope of the linear part, ≥ 0
  double cutoff = 0;                        // where the linear part ends: 0 to below 1
};

// `brightness` 0 to 1 scales the light; 0: completely dark.
Lut MakeLut(const ColorCurve& curve, double brightness);

}  // namespace voxeld::display::fadecandy
