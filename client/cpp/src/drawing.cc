#include "voxeld/drawing.h"

#include <cmath>

namespace voxeld::client {

Affine Affine::Translate(const Vec3& by) { return {{1, 0, 0, by.x, 0, 1, 0, by.y, 0, 0, 1, by.z}}; }

Affine Affine::Scale(const Vec3& by) { return {{by.x, 0, 0, 0, 0, by.y, 0, 0, 0, 0, by.z, 0}}; }

Affine Affine::Rotate(const Vec3& axis, double radians) {
  const double length = std::sqrt(axis.x * axis.x + axis.y * axis.y + axis.z * axis.z);
  const double x = axis.x / length, y = axis.y / length, z = axis.z / length;
  const double c = std::cos(radians), s = std::sin(radians), k = 1 - c;
  return {{k * x * x + c, k * x * y - s * z, k * x * z + s * y, 0,  //
           k * x * y + s * z, k * y * y + c, k * y * z - s * x, 0,  //
           k * x * z - s * y, k * y * z + s * x, k * z * z + c, 0}};
}

Affine operator*(const Affine& second, const Affine& first) {
  Affine out;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 4; ++column) {
      double sum = column == 3 ? second.m[row * 4 + 3] : 0;
      for (size_t k = 0; k < 3; ++k) sum += second.m[row * 4 + k] * first.m[k * 4 + column];
      out.m[row * 4 + column] = sum;
    }
  }
  return out;
}

}  // namespace voxeld::client
