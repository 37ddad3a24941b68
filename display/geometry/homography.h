// Plane projective maps: (u, v) ↦ (x/w, y/w) with (x, y, w) = M·(u, v, 1).
#pragma once

#include <array>

namespace voxeld::display {

struct PicturePlace {
  double u = 0, v = 0;
};

struct Homography {
  std::array<double, 9> m{1, 0, 0, 0, 1, 0, 0, 0, 1};  // row by row

  double WeightAt(PicturePlace p) const { return m[6] * p.u + m[7] * p.v + m[8]; }
  PicturePlace At(PicturePlace p) const {
    const double w = WeightAt(p);
    return {(m[0] * p.u + m[1] * p.v + m[2]) / w, (m[3] * p.u + m[4] * p.v + m[5]) / w};
  }
  double Determinant() const {
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
  }
  // Requires: the determinant is above 0.
  Homography Inverse() const {
    const double d = Determinant();
    return {{(m[4] * m[8] - m[5] * m[7]) / d, (m[2] * m[7] - m[1] * m[8]) / d,
             (m[1] * m[5] - m[2] * m[4]) / d, (m[5] * m[6] - m[3] * m[8]) / d,
             (m[0] * m[8] - m[2] * m[6]) / d, (m[2] * m[3] - m[0] * m[5]) / d,
             (m[3] * m[7] - m[4] * m[6]) / d, (m[1] * m[6] - m[0] * m[7]) / d,
             (m[0] * m[4] - m[1] * m[3]) / d}};
  }
};

}  // namespace voxeld::display
