#include "tests/conformance/oracle_clip.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace voxeld::gpu::conformance {
namespace {

// Gauss-Jordan elimination with the greatest pivots. Returns false if no inverse exists.
bool Invert(const Affine& view, long double inverse[3][4]) {
  long double rows[3][7] = {};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rows[r][c] = view.m[r * 4 + c];
    rows[r][3 + r] = 1;
    rows[r][6] = -static_cast<long double>(view.m[r * 4 + 3]);
  }
  for (int c = 0; c < 3; ++c) {
    int pivot = c;
    for (int r = c + 1; r < 3; ++r) {
      if (std::fabs(rows[r][c]) > std::fabs(rows[pivot][c])) pivot = r;
    }
    if (rows[pivot][c] == 0) return false;
    std::swap_ranges(rows[c], rows[c] + 7, rows[pivot]);
    const long double by = rows[c][c];
    for (long double& value : rows[c]) value /= by;
    for (int r = 0; r < 3; ++r) {
      if (r == c) continue;
      const long double times = rows[r][c];
      for (int k = 0; k < 7; ++k) rows[r][k] -= times * rows[c][k];
    }
  }
  // The identity has become the left part; the right part is the inverse, and its product with −t.
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) inverse[r][c] = rows[r][3 + c];
  }
  return true;
}

double Greatest(double x, double y, double z) {
  return std::max(std::max(std::fabs(x), std::fabs(y)), std::fabs(z));
}

// Returns the nearest integer, halves away from zero, within ±2^bits.
__int128 Rounded(double value, int bits) {
  const double limit = std::ldexp(1.0, bits);
  if (std::fabs(value) >= limit) return static_cast<__int128>(std::copysign(limit, value));
  return static_cast<__int128>(std::copysign(std::floor(std::fabs(value) + 0.5), value));
}

// Applies the published rounding of a plane: doubles, in the given order. Returns false if it has
// no place in voxel space.
bool Round(const double plane[4], const Affine& view, __int128 out[4]) {
  const auto m = [&](int i, int j) { return view.m[(i % 3) * 4 + j % 3]; };
  const double determinant = (m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1)) -
                              m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0))) +
                             m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0));
  if (determinant == 0 || !std::isfinite(determinant)) return false;
  // Scales the plane by a power of two, so that its normal's greatest component is in [½, 1).
  double p[4];
  const int scene_scale = std::ilogb(Greatest(plane[0], plane[1], plane[2])) + 1;
  for (int i = 0; i < 4; ++i) p[i] = std::scalbn(plane[i], -scene_scale);
  double normal[3];
  for (int i = 0; i < 3; ++i) {
    double sum = 0;
    for (int j = 0; j < 3; ++j) {
      double cofactor = m(i + 1, j + 1) * m(i + 2, j + 2) - m(i + 1, j + 2) * m(i + 2, j + 1);
      if (determinant < 0) cofactor = -cofactor;
      sum = j == 0 ? cofactor * p[0] : sum + cofactor * p[j];
    }
    normal[i] = sum;
  }
  double moved = normal[0] * view.m[3];
  moved = moved + normal[1] * view.m[7];
  moved = moved + normal[2] * view.m[11];
  const double offset = std::fabs(determinant) * p[3] - moved;
  const double greatest = Greatest(normal[0], normal[1], normal[2]);
  if (greatest == 0 || !std::isfinite(greatest) || std::isnan(offset)) return false;
  const int scale = 37 - std::ilogb(greatest);
  for (int i = 0; i < 3; ++i) out[i] = Rounded(std::scalbn(normal[i], scale), 38);
  out[3] = Rounded(std::scalbn(offset, scale + 1), 61);
  return true;
}

}  // namespace

OracleClip::OracleClip(const LayerRecord& layer, const Target& target) {
  const display::VoxelGrid& grid = target.geometry.grid;
  // Four times the error that gpu/clip.h states for the rounding: doubles come before it.
  least_distance_ = std::ldexp(static_cast<long double>(grid.nx + grid.ny + grid.nz + 1), -36);
  invertible_ = Invert(target.view, inverse_);
  for (uint32_t i = 0; i < layer.cylinder_count; ++i) {
    cylinders_.push_back(CylinderOf(layer.cylinders[i], target.view));
  }
  std::vector<std::vector<double>> scene;
  for (uint32_t i = 0; i < layer.plane_count; ++i) {
    const ClipPlane& p = layer.planes[i];
    scene.push_back({p.a, p.b, p.c, p.d});
  }
  if (layer.has_region != 0) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        std::vector<double> face(4);
        face[static_cast<size_t>(axis)] = sign;
        face[3] = sign > 0 ? -layer.region.min[axis] : layer.region.max[axis];
        scene.push_back(face);
      }
    }
  }
  for (const std::vector<double>& values : scene) {
    Plane plane;
    std::copy(values.begin(), values.end(), plane.scene);
    plane.exists = Round(values.data(), target.view, plane.rounded);
    plane.per_voxel = 0;
    for (int axis = 0; axis < 3; ++axis) {
      long double slope = 0;
      for (int r = 0; r < 3; ++r) slope += plane.scene[r] * inverse_[r][axis];
      plane.per_voxel = std::max(plane.per_voxel, std::fabs(slope));
    }
    planes_.push_back(plane);
  }
}

// Applies the published rounding: the inverse of view ∘ unit by cofactors, in doubles.
OracleClip::Cylinder OracleClip::CylinderOf(const ClipCylinder& cylinder, const Affine& view) {
  Cylinder out;
  double m[3][4];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) {
      double sum = view.m[r * 4] * cylinder.unit.m[c];
      sum = sum + view.m[r * 4 + 1] * cylinder.unit.m[4 + c];
      sum = sum + view.m[r * 4 + 2] * cylinder.unit.m[8 + c];
      m[r][c] = c == 3 ? sum + view.m[r * 4 + 3] : sum;
    }
  }
  const double determinant = (m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                              m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])) +
                             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  const int next[3] = {1, 2, 0}, last[3] = {2, 0, 1};
  bool is_finite = determinant != 0;
  for (int r = 0; r < 2; ++r) {
    double base = 0;
    for (int c = 0; c < 3; ++c) {
      const double cofactor =
          m[next[c]][next[r]] * m[last[c]][last[r]] - m[next[c]][last[r]] * m[last[c]][next[r]];
      const double inverse = cofactor / determinant;
      out.rounded[r][c] = inverse * 0.5;
      base -= inverse * m[c][3];
      is_finite = is_finite && std::isfinite(inverse) && std::isfinite(base);
    }
    out.rounded[r][3] = base;
  }
  out.exists = is_finite && Invert(cylinder.unit, out.inverse);
  return out;
}

bool OracleClip::IsInside(const Cylinder& cylinder, const long double scene[3], int64_t x,
                          int64_t y, int64_t z) const {
  long double square = 0;
  for (int r = 0; r < 2; ++r) {
    long double q = cylinder.inverse[r][3];
    for (int c = 0; c < 3; ++c) q += cylinder.inverse[r][c] * scene[c];
    square += q * q;
  }
  if (std::fabs(square - 1) > 1e-6L) return square < 1;
  ++near_;
  double rounded = 0;
  for (const double* row : {cylinder.rounded[0], cylinder.rounded[1]}) {
    double q = row[0] * static_cast<double>(2 * x + 1);
    q = q + row[1] * static_cast<double>(2 * y + 1);
    q = q + row[2] * static_cast<double>(2 * z + 1);
    q = q + row[3];
    rounded = rounded + q * q;
  }
  return rounded <= 1;
}

bool OracleClip::IsInside(const Plane& plane, const long double scene[3], int64_t x, int64_t y,
                          int64_t z) const {
  const long double value = plane.scene[0] * scene[0] + plane.scene[1] * scene[1] +
                            plane.scene[2] * scene[2] + plane.scene[3];
  if (std::fabs(value) > least_distance_ * plane.per_voxel) return value > 0;
  ++near_;
  return plane.rounded[0] * (2 * x + 1) + plane.rounded[1] * (2 * y + 1) +
             plane.rounded[2] * (2 * z + 1) + plane.rounded[3] >=
         0;
}

bool OracleClip::Has(int64_t x, int64_t y, int64_t z) const {
  if (planes_.empty() && cylinders_.empty()) return true;
  if (!invertible_) return false;
  const long double centre[3] = {static_cast<long double>(x) + 0.5L,
                                 static_cast<long double>(y) + 0.5L,
                                 static_cast<long double>(z) + 0.5L};
  long double scene[3];
  for (int r = 0; r < 3; ++r) {
    scene[r] = inverse_[r][3];
    for (int c = 0; c < 3; ++c) scene[r] += inverse_[r][c] * centre[c];
  }
  for (const Cylinder& cylinder : cylinders_) {
    if (!cylinder.exists || !IsInside(cylinder, scene, x, y, z)) return false;
  }
  return std::all_of(planes_.begin(), planes_.end(), [&](const Plane& plane) {
    return plane.exists && IsInside(plane, scene, x, y, z);
  });
}

}  // namespace voxeld::gpu::conformance
