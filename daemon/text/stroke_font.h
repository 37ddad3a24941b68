// Hershey's stroke fonts, as the package hershey-fonts-data has them: letters of a few straight strokes,
// legible where an outline would drown.
//
// The files (.jhf) hold a glyph a line from the space on, in ASCII's order: columns 0 to 4 a number, 5 to 7 how
// many pairs of characters follow, of which the first are the left and right edge, each the distance of its
// code from 'R', y downwards; " R" lifts the pen.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::text {

struct StrokePoint {
  float x = 0, y = 0;
};
using Stroke = std::vector<StrokePoint>;  // two points at least

// Immutable.
class StrokeFont {
 public:
  // Where Debian's package puts them, as "futural", "rowmans", "greek". NotFound says where it looked.
  static absl::StatusOr<StrokeFont> Load(std::string_view name);
  // InvalidArgument says which line is wrong.
  static absl::StatusOr<StrokeFont> Parse(std::string_view jhf);

  struct Line {
    std::vector<Stroke> strokes;
    float width = 0;
  };
  // One line, its baseline at y = 0 from x = 0 on, y upwards, capitals 1 high. What the font has not is a
  // question mark.
  Line Lay(std::string_view ascii) const;

 private:
  struct Glyph {
    float left = 0, right = 0;
    std::vector<Stroke> strokes;  // in the file's units, y upwards from the baseline
  };
  std::vector<Glyph> glyphs_;  // from the space on
};

}  // namespace voxeld::text
