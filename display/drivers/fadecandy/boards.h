// Which boards a display wants, and the numbers of their pixels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "display/drivers/fadecandy/protocol.h"
#include "display/drivers/options.h"
#include "display/drivers/wiring/wiring.h"

namespace voxeld::display::fadecandy {

inline constexpr int64_t kMostBoards = 64;

// The boards that a display wants, in the order of their pixels.
struct Boards {
  // One a board; empty ones: whichever there are, in ascending order of serial number.
  std::vector<std::string> serials;
};
// boards=N or boards=SERIAL;SERIAL;…
Boards ReadBoards(OptionReader& reader);

// A pixel's number counts over all boards: board · 512 + strip · 64 + place on the strip.
inline wiring::PixelNumbers PixelsOf(int32_t boards) {
  return {.a_slice = kPixels, .slices = boards, .a_strip = kStripPixels, .unit = "board"};
}

}  // namespace voxeld::display::fadecandy
