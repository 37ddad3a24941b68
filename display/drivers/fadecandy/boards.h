// The boards that a display uses, and the numbers of their pixels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "display/drivers/fadecandy/protocol.h"
#include "display/drivers/options.h"
#include "display/drivers/wiring/wiring.h"

namespace voxeld::display::fadecandy {

inline constexpr int64_t kMostBoards = 64;

// The boards that a display uses, in the order of their pixels.
struct Boards {
  // One per board; empty ones: any boards, in ascending order of serial number.
  std::vector<std::string> serials;
};
// Reads boards=N or boards=SERIAL;SERIAL;…
Boards ReadBoards(OptionReader& reader);

// Pixels are numbered over all boards: board · 512 + strip · 64 + place on the strip.
inline wiring::PixelNumbers PixelsOf(int32_t boards) {
  return {.a_slice = kPixels, .slices = boards, .a_strip = kStripPixels, .unit = "board"};
}

}  // namespace voxeld::display::fadecandy
