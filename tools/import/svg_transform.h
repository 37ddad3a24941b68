// Transforms of SVG ("Scalable Vector Graphics 1.1", section 7.6).
#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "tools/import/svg_path.h"

namespace voxeld::voxelctl {

// x' = a·x + c·y + e, y' = b·x + d·y + f
struct Matrix2 {
  double a = 1, b = 0, c = 0, d = 1, e = 0, f = 0;

  Point2 operator()(const Point2& p) const {
    return {a * p.x + c * p.y + e, b * p.x + d * p.y + f};
  }
  // What is mapped by `inner` first.
  Matrix2 operator*(const Matrix2& inner) const {
    return {a * inner.a + c * inner.b,     b * inner.a + d * inner.b,
            a * inner.c + c * inner.d,     b * inner.c + d * inner.d,
            a * inner.e + c * inner.f + e, b * inner.e + d * inner.f + f};
  }
};

// A list of matrix, translate, scale, rotate, skewX and skewY with their numbers; nothing of what is none.
std::optional<Matrix2> ParseSvgTransform(absl::string_view text);

}  // namespace voxeld::voxelctl
