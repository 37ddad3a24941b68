// Reads Hershey's stroke fonts from the package hershey-fonts-data: letters of a few straight
// strokes, which stay legible where outlines would not.
//
// The files (.jhf) contain one glyph per line in the order of ASCII, beginning with the space.
// Columns 0 to 4 hold a number, columns 5 to 7 the number of character pairs that follow. The first
// pair is the left and right edge. Each value is the distance of the character code from 'R', with
// y downwards; " R" lifts the pen.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::text {

struct StrokePoint {
  float x = 0, y = 0;
};
using Stroke = std::vector<StrokePoint>;  // at least two points

// Immutable.
class StrokeFont {
 public:
  // Loads a font such as "futural", "rowmans" or "greek" from the folder of Debian's package.
  // Errors: NotFound with the paths that were tried.
  static absl::StatusOr<StrokeFont> Load(std::string_view name);
  // Errors: InvalidArgument with the invalid line.
  static absl::StatusOr<StrokeFont> Parse(std::string_view jhf);

  struct Line {
    std::vector<Stroke> strokes;
    float width = 0;
  };
  // Lays out one line with its baseline at y = 0, starting at x = 0, y upwards, capitals 1 high.
  // Missing characters become question marks.
  Line Lay(std::string_view ascii) const;

 private:
  struct Glyph {
    float left = 0, right = 0;
    std::vector<Stroke> strokes;  // in the file's units, y upwards from the baseline
  };
  std::vector<Glyph> glyphs_;  // beginning with the space
};

}  // namespace voxeld::text
