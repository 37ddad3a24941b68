#include "daemon/scene/bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_format.h"

namespace voxeld::daemon {

void Bounds::Include(const Bounds& other) {
  if (other.empty) return;
  if (empty) {
    *this = other;
    return;
  }
  for (int axis = 0; axis < 3; ++axis) {
    min[axis] = std::min(min[axis], other.min[axis]);
    max[axis] = std::max(max[axis], other.max[axis]);
  }
}

Bounds MapBounds(const gpu::Affine& map, const Bounds& box) {
  Bounds out;
  if (box.empty) return out;
  out.empty = false;
  for (int row = 0; row < 3; ++row) {
    double low = map.m[row * 4 + 3], high = low;
    for (int axis = 0; axis < 3; ++axis) {
      const double a = map.m[row * 4 + axis] * box.min[axis];
      const double b = map.m[row * 4 + axis] * box.max[axis];
      // Not std::min, because a NaN (infinity times 0) must propagate.
      low += a < b ? a : b;
      high += a < b ? b : a;
    }
    out.min[row] = low;
    out.max[row] = high;
  }
  return out;
}

double LargestMagnitude(const Bounds& box) {
  if (box.empty) return 0;
  double largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double value : {box.min[axis], box.max[axis]}) {
      if (!std::isfinite(value)) return std::numeric_limits<double>::infinity();
      if (std::abs(value) > std::abs(largest)) largest = value;
    }
  }
  return largest;
}

bool IsFinite(const gpu::Affine& map) {
  return std::all_of(std::begin(map.m), std::end(map.m), [](double v) { return std::isfinite(v); });
}

bool IsSingular(const gpu::Affine& map) {
  constexpr double kLeast = 1e-12;
  gpu::Affine unit = map;
  for (int row = 0; row < 3; ++row) {
    double* m = unit.m + row * 4;
    const double largest = std::max({std::abs(m[0]), std::abs(m[1]), std::abs(m[2])});
    if (!(largest > 0) || !std::isfinite(largest)) return true;
    for (int col = 0; col < 3; ++col) m[col] /= largest;
    const double length = std::sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
    for (int col = 0; col < 3; ++col) m[col] /= length;
  }
  // Drawing uses the map's determinant without normalisation, so it must not vanish or overflow
  // either.
  const double determinant = gpu::Determinant(map);
  return !(std::abs(gpu::Determinant(unit)) >= kLeast) || determinant == 0 ||
         !std::isfinite(determinant);
}

std::string DescribeLinear(const gpu::Affine& map) {
  const double* m = map.m;
  return absl::StrFormat("determinant %g of [%g %g %g; %g %g %g; %g %g %g]", gpu::Determinant(map),
                         m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
}

}  // namespace voxeld::daemon
