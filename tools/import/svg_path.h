// Path data of SVG ("Scalable Vector Graphics 1.1", section 8.3), as lines.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

struct Point2 {
  double x = 0, y = 0;
};

struct Polyline {
  std::vector<Point2> points;
  bool closed = false;
};

// Takes a number, with what may stand between it and the one before, from the front of `text`. False: there is none.
bool TakeNumber(absl::string_view* text, double* number);

// From `from` by a cubic Bézier, in pieces, without the first point.
void AddCubic(Point2 from, Point2 a, Point2 b, Point2 to, std::vector<Point2>* out);

// Curves are 32 pieces each, arcs pieces of 5° at most. InvalidArgument says what was found at which character;
// ResourceExhausted: more than `most` points.
absl::StatusOr<std::vector<Polyline>> ParseSvgPath(absl::string_view data, size_t most);

}  // namespace voxeld::voxelctl
