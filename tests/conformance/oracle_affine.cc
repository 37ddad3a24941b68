#include <algorithm>
#include <cmath>

#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {

// Products and sums from the left, in the order in which a matrix product is written.
static double Dot3(const double* row, double x, double y, double z) {
  const double factors[3] = {x, y, z};
  double sum = row[0] * factors[0];
  for (int k = 1; k < 3; ++k) sum = sum + row[k] * factors[k];
  return sum;
}

Affine OracleCompose(const Affine& outer, const Affine& inner) {
  Affine result;
  for (int i = 0; i < 12; ++i) {
    const double* row = &outer.m[i / 4 * 4];
    const int column = i % 4;
    result.m[i] = Dot3(row, inner.m[column], inner.m[column + 4], inner.m[column + 8]);
    if (column == 3) result.m[i] += row[3];
  }
  return result;
}

Units OracleSnap(const Affine& map, const float* p) {
  Units u;
  for (int a = 0; a < 3; ++a) {
    const double* row = &map.m[a * 4];
    const double position = Dot3(row, p[0], p[1], p[2]) + row[3];
    u.v[a] = static_cast<int64_t>(std::clamp(std::floor(position * 256 + 0.5), -0x1p38, 0x1p38));
  }
  return u;
}

double OracleScale(const Affine& map) {
  const auto c = [&](int row, int column) { return map.m[row * 4 + column]; };
  double determinant = 0;  // the six permutations
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    determinant += c(0, i) * (c(1, j) * c(2, k) - c(1, k) * c(2, j));
  }
  return std::cbrt(std::fabs(determinant));
}

}  // namespace voxeld::gpu::conformance
