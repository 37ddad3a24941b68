#include "gpu/clip.h"

#include <algorithm>
#include <cmath>

namespace voxeld::gpu {
namespace {

// Rounds to the nearest whole number, halves away from zero; saturates. Requires: `x` is not NaN.
int64_t RoundSymmetric(double x, int64_t most) {
  const double size = x < 0 ? -x : x;
  const int64_t rounded =
      size >= static_cast<double>(most) ? most : Min(most, FloorToInt(size + 0.5));
  return x < 0 ? -rounded : rounded;
}

double GreatestSize(const double v[3]) {
  return std::max({std::fabs(v[0]), std::fabs(v[1]), std::fabs(v[2])});
}

// Maps a plane n·p + d of scene space to one of voxel space: n·A⁻¹(q − t) + d, multiplied by the
// size of A's determinant, so that nothing is divided by it.
struct PlaneMap {
  double cofactor[3]
                 [3];  // of the view's linear part, by row and column, with the determinant's sign
  double shift[3];
  double size;  // of the determinant, its absolute value

  explicit PlaneMap(const Affine& view) {
    const double determinant = Determinant(view);
    const double sign = determinant < 0 ? -1 : 1;
    for (int row = 0; row < 3; ++row) {
      for (int col = 0; col < 3; ++col) {
        cofactor[row][col] = sign * Cofactor(view, row, col);
      }
      shift[row] = view.m[row * 4 + 3];
    }
    size = determinant * sign;
  }

  VoxelHalfSpace Of(const ClipPlane& plane) const {
    // Scaling by powers of two is exact: it keeps the following operations clear of over- and
    // underflow.
    const double scene[3] = {plane.a, plane.b, plane.c};
    int exponent = 0;
    std::frexp(GreatestSize(scene), &exponent);
    double n[3];
    for (int a = 0; a < 3; ++a) n[a] = std::ldexp(scene[a], -exponent);
    const double d = std::ldexp(plane.d, -exponent);

    double normal[3];
    for (int row = 0; row < 3; ++row) {
      const double* c = cofactor[row];
      normal[row] = (c[0] * n[0] + c[1] * n[1]) + c[2] * n[2];
    }
    const double offset =
        size * d - ((normal[0] * shift[0] + normal[1] * shift[1]) + normal[2] * shift[2]);
    const double greatest = GreatestSize(normal);
    // A view without an inverse also ends here.
    if (!(size > 0) || !std::isfinite(size) || !(greatest > 0) || !std::isfinite(greatest) ||
        std::isnan(offset)) {
      return NowhereInside();
    }
    std::frexp(greatest, &exponent);
    constexpr int kNormalBits = 38;
    VoxelHalfSpace half_space;
    for (int a = 0; a < 3; ++a) {
      half_space.normal[a] =
          RoundSymmetric(std::ldexp(normal[a], kNormalBits - exponent), kMaxClipNormal);
    }
    // The offset is in half voxels.
    half_space.offset =
        RoundSymmetric(std::ldexp(offset, kNormalBits + 1 - exponent), kMaxClipOffset);
    return half_space;
  }
};

// Without an inverse, no voxel is inside.
VoxelCylinder MapCylinder(const ClipCylinder& cylinder, const Affine& view) {
  const Affine map = Compose(view, cylinder.unit);  // x² + y² ≤ 1 → voxel space
  const double determinant = Determinant(map);
  VoxelCylinder out;
  bool is_finite = determinant != 0;
  for (int r = 0; r < 2; ++r) {
    VoxelCylinder::Row& row = out.rows[r];
    double base = 0;
    for (int c = 0; c < 3; ++c) {
      const double inverse = Cofactor(map, c, r) / determinant;
      row.by[c] = inverse / 2;
      base = base - inverse * map.m[c * 4 + 3];
      is_finite = is_finite && std::isfinite(inverse);
    }
    row.base = base;
    is_finite = is_finite && std::isfinite(base);
  }
  if (is_finite) return out;
  VoxelCylinder nowhere;
  nowhere.rows[0].base = 2;
  return nowhere;
}

}  // namespace

VoxelClip MapClip(const LayerRecord& layer, const Affine& view) {
  VoxelClip clip;
  for (uint32_t i = 0; i < layer.cylinder_count; ++i) {
    clip.cylinders[clip.cylinder_count++] = MapCylinder(layer.cylinders[i], view);
  }
  if (layer.plane_count == 0 && layer.has_region == 0) return clip;
  const PlaneMap map(view);
  const auto add = [&](const ClipPlane& plane) { clip.half_spaces[clip.count++] = map.Of(plane); };
  for (uint32_t i = 0; i < layer.plane_count; ++i) add(layer.planes[i]);
  if (layer.has_region != 0) {
    const Region& r = layer.region;
    add({1, 0, 0, -r.min[0]});
    add({-1, 0, 0, r.max[0]});
    add({0, 1, 0, -r.min[1]});
    add({0, -1, 0, r.max[1]});
    add({0, 0, 1, -r.min[2]});
    add({0, 0, -1, r.max[2]});
  }
  return clip;
}

}  // namespace voxeld::gpu
