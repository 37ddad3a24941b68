// Affine maps in double precision. They are composed and applied in one fixed order of operations,
// so that every machine gets the same bits (the build turns off contraction for both compilers).
#pragma once

#include <array>
#include <cmath>

#include "gpu/portable.h"

namespace voxeld::gpu {

// Row-major 3×4: p ↦ (m[0]x + m[1]y + m[2]z + m[3], …).
struct Affine {
  double m[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  bool operator==(const Affine&) const = default;
};

struct Point3d {
  double x, y, z;
};

VOXELD_HD inline Point3d Map(const Affine& a, double x, double y, double z) {
  return {((a.m[0] * x + a.m[1] * y) + a.m[2] * z) + a.m[3],
          ((a.m[4] * x + a.m[5] * y) + a.m[6] * z) + a.m[7],
          ((a.m[8] * x + a.m[9] * y) + a.m[10] * z) + a.m[11]};
}

// Returns outer ∘ inner: inner is applied first.
VOXELD_HD inline Affine Compose(const Affine& outer, const Affine& inner) {
  Affine r;
  for (int row = 0; row < 3; ++row) {
    const double* o = outer.m + row * 4;
    for (int col = 0; col < 4; ++col) {
      const double sum = (o[0] * inner.m[col] + o[1] * inner.m[4 + col]) + o[2] * inner.m[8 + col];
      r.m[row * 4 + col] = col == 3 ? sum + o[3] : sum;
    }
  }
  return r;
}

// Returns the determinant of the linear part.
VOXELD_HD inline double Determinant(const Affine& a) {
  const double* m = a.m;
  return (m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8])) +
         m[2] * (m[4] * m[9] - m[5] * m[8]);
}

// Returns the cofactor of an entry of the linear part. Row r of the inverse has entries Cofactor(a,
// c, r) / Determinant(a).
inline double Cofactor(const Affine& a, int row, int col) {
  const auto at = [&](int i, int j) { return a.m[i % 3 * 4 + j % 3]; };
  return at(row + 1, col + 1) * at(row + 2, col + 2) - at(row + 1, col + 2) * at(row + 2, col + 1);
}

}  // namespace voxeld::gpu
