// What closed curves fill, as triangles.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "tools/import/svg_path.h"

namespace voxeld::voxelctl {

enum class FillRule : uint8_t { kNonZero, kEvenOdd };

struct Triangles {
  std::vector<Point2> points;
  std::vector<uint32_t> indices;  // three a triangle
};

// How much work is left for the curves of a file; what crosses itself a million times would take memory without end.
struct FillBudget {
  uint64_t comparisons = 200'000'000;  // of two pieces of curves
  uint64_t crossings = 300'000;
  uint64_t points = 2'000'000;
};

// Curves are closed, holes are by the rule, and curves may cross themselves and each other. All coordinates must be finite. No
// triangle: nothing has an area. Nothing: the budget, of which what was done is taken, is not enough.
std::optional<Triangles> FillCurves(const std::vector<Polyline>& curves, FillRule rule,
                                    FillBudget* budget);

}  // namespace voxeld::voxelctl
