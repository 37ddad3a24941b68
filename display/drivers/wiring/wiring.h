// Positions of the lights of an LED lattice, and which pixel is which light: from options, or from
// a layout file of Open Pixel Control. The drivers' README.md files list the options.
//
// Pixels are numbered over all slices: slice · a_slice + place in it; strips follow one another at
// a_strip pixels.
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
  int32_t a_slice = 0;    // pixels in a slice: those of a board, or a packet
  int32_t slices = 0;     // 1 or more
  int32_t a_strip = 0;    // from the beginning of one strip to that of the next
  const char* unit = "";  // name of what a slice is: "board"
  int32_t count() const { return a_slice * slices; }
};

// How a cube's lights are wired to its strips.
struct CubeWiring {
  enum class Serpentine : uint8_t { kNone, kRows, kRowsAndSlices };
  // Lights along x, y, z before the cube is turned.
  std::array<int32_t, 3> size = {8, 8, 8};
  // Axes (0 x, 1 y, 2 z) along which the chain runs: `order[0]` within a row, `order[1]` from row
  // to row of a slice, `order[2]` from slice to slice.
  std::array<int, 3> order = {0, 1, 2};
  // kRows: every second row of a slice runs backwards. kRowsAndSlices: the rows of every second
  // slice are also in backward order, and the chain never jumps.
  Serpentine serpentine = Serpentine::kNone;
  bool reverse = false;           // the chain begins at its other end
  std::array<bool, 3> flip = {};  // mirrors x, y, z
  int quarter_turns = 0;          // then about +z, counter-clockwise seen from above
  int32_t per_strip = 64;         // lights used on each strip, from its beginning
  int32_t first = 0;              // pixel number of the chain's first light
};

// Returns lights at the middle of cells of `pitch_mm`; the cube's middle is the origin. Errors:
// InvalidArgument if it needs more pixels than exist.
absl::StatusOr<Lattice> CubeLattice(const CubeWiring& wiring, const PixelNumbers& numbers,
                                    double pitch_mm);

// `json` is an array with an entry per pixel, in the order of their numbers: {"point": [x, y, z]},
// or null or {} for a pixel without a light. A unit is `pitch_mm`; the middle of the points' box is
// the origin. Errors: InvalidArgument, naming the entry, for any other format, for numbers beyond
// 1e6 mm, for two lights at one point, for no lights, and for more entries than pixels.
absl::StatusOr<Lattice> ParseLayout(std::string_view json, const PixelNumbers& numbers,
                                    double pitch_mm);

// Reads cube=… or layout=FILE and the related options. A bad value is Refused.
absl::StatusOr<Lattice> ReadLattice(OptionReader& reader, const PixelNumbers& numbers);

// Sets the lattice as the geometry of `info`, with its default grid. Errors: InvalidArgument,
// naming the display, for an invalid lattice, and the error of ReadLattice.
absl::Status TakeLattice(DisplayInfo& info, absl::StatusOr<Lattice> lattice);

}  // namespace voxeld::display::wiring
