// Where the lights of an LED lattice stand, and which pixel is which light: from options, or from a layout file of Open Pixel
// Control. The drivers' README.md list the options.
//
// A pixel's number counts over all slices: slice · a_slice + place in it; strips follow one another at a_strip pixels.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/api/geometry.h"
#include "display/drivers/options.h"

namespace voxeld::display::wiring {

// How pixels are numbered.
struct PixelNumbers {
  int32_t a_slice = 0;    // in a slice: what a board, or a packet, has
  int32_t slices = 0;     // 1 or more
  int32_t a_strip = 0;    // from the beginning of a strip to that of the next
  const char* unit = "";  // of which a slice is one: "board"
  int32_t count() const { return a_slice * slices; }
};

// How a cube's lights hang on its strips.
struct CubeWiring {
  enum class Serpentine : uint8_t { kNone, kRows, kRowsAndSlices };
  // Lights along x, y, z before the cube is turned.
  std::array<int32_t, 3> size = {8, 8, 8};
  // Axes (0 x, 1 y, 2 z) along which the chain runs: `order[0]` a row, `order[1]` from row to row
  // of a slice, `order[2]` from slice to slice.
  std::array<int, 3> order = {0, 1, 2};
  // kRows: every second row of a slice runs backwards. kRowsAndSlices: the rows of every second
  // slice come in backward order as well, and the chain never jumps.
  Serpentine serpentine = Serpentine::kNone;
  bool reverse = false;           // the chain begins at what is else its end
  std::array<bool, 3> flip = {};  // mirrors x, y, z
  int quarter_turns = 0;          // then about +z, counter-clockwise seen from above
  int32_t per_strip = 64;         // lights used of each strip, from its beginning
  int32_t first = 0;              // pixel number of the chain's first light
};

// The lights at the middle of cells of `pitch_mm`; the cube's middle is the origin. InvalidArgument if it needs more pixels than
// there are.
absl::StatusOr<Lattice> CubeLattice(const CubeWiring& wiring, const PixelNumbers& numbers,
                                    double pitch_mm);

// `json`: an array with an entry a pixel, in the order of their numbers: {"point": [x, y, z]}, or
// null or {} where there is no light. A unit is `pitch_mm`; the middle of the points' box is the
// origin. InvalidArgument, naming the entry, for what is not that, for numbers beyond 1e6 mm, for
// two lights at one point, for none, and for more entries than pixels.
absl::StatusOr<Lattice> ParseLayout(std::string_view json, const PixelNumbers& numbers,
                                    double pitch_mm);

// cube=… or layout=FILE and what belongs to them. A bad value is Refused.
absl::StatusOr<Lattice> ReadLattice(OptionReader& reader, const PixelNumbers& numbers);

// The lattice as the geometry of `info`, with the grid that suits it. InvalidArgument, naming the display, for one that cannot
// be, and for what ReadLattice said.
absl::Status TakeLattice(DisplayInfo& info, absl::StatusOr<Lattice> lattice);

}  // namespace voxeld::display::wiring
