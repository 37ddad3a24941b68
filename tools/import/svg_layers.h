// What a drawing paints, one over another, into the levels of a model.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tools/voxelctl/import/model.h"
#include "tools/import/svg_path.h"

namespace voxeld::voxelctl {

// One paint of one element, in the drawing's coordinates (y down), all finite.
struct SvgLayer {
  std::vector<Point2> points;
  std::vector<uint32_t> triangles;  // three each
  std::vector<uint32_t> segments;   // two each
  Rgb color;
  double opacity = 1;   // there is nothing to see through: colours are as much darker
  bool stroke = false;  // not what is filled
};

struct LayeredParts {
  std::vector<Part> parts;  // at most one of each kind in a level, upright (y up), levels ascending
  std::string note;         // usually empty
};

// In the order in which they were painted. What overlaps another of another colour is in a higher level than that, by 64 by 64 cells.
// On a display what is black is dark. So dark strokes are white, and dark areas, too, if there are no others; a white sheet behind all
// is left out where there is something dark, and said.
LayeredParts ToParts(std::vector<SvgLayer> layers);

}  // namespace voxeld::voxelctl
