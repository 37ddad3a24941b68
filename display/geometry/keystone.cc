#include "display/geometry/keystone.h"

#include <cmath>

namespace voxeld::display {

// Computed from the unit square first (Heckbert, Fundamentals of Texture Mapping and Image Warping,
// 1989, §2.2.3), which a scale and a shift map to the image's corners.
std::optional<Homography> HomographyOfCorners(PicturePlace half,
                                              const std::array<PicturePlace, 4>& to) {
  const auto& [a, b, c, d] = to;
  const double dx1 = b.u - c.u, dx2 = d.u - c.u, sx = a.u - b.u + c.u - d.u;
  const double dy1 = b.v - c.v, dy2 = d.v - c.v, sy = a.v - b.v + c.v - d.v;
  const double det = dx1 * dy2 - dx2 * dy1;
  if (det == 0) return std::nullopt;
  const double g = (sx * dy2 - dx2 * sy) / det, h = (dx1 * sy - sx * dy1) / det;
  const double square[9] = {b.u - a.u + g * b.u,
                            d.u - a.u + h * d.u,
                            a.u,
                            b.v - a.v + g * b.v,
                            d.v - a.v + h * d.v,
                            a.v,
                            g,
                            h,
                            1};
  Homography out;
  for (size_t row = 0; row < 3; ++row) {
    const double* const m = square + 3 * row;
    out.m[3 * row] = m[0] / (2 * half.u);
    out.m[3 * row + 1] = m[1] / (2 * half.v);
    out.m[3 * row + 2] = m[0] / 2 + m[1] / 2 + m[2];
  }
  // Normalise w to 1 in the middle.
  const double w = out.m[8];
  for (double& m : out.m) m /= w;
  if (!std::isfinite(out.m[0]) || !(out.Determinant() != 0)) return std::nullopt;
  return out;
}

}  // namespace voxeld::display
