// Textures on triangles.
//
// A texture is stored in levels: the first is the image itself, and each of the others has half the
// sides of the one before, rounded down, until both are 1. A triangle uses the first level whose
// texels are on average no smaller than half a voxel's face, as seen along its normal's greatest
// component, or else the last level. A voxel has the texel at the place of its centre, weighted as
// colours are (triangle.h); a vertex's voxel has the texel at the vertex's place.
//
// Places: (0, 0) is the image's upper left corner, (1, 1) its lower right one; beyond them it
// repeats. A whole number above 0 is the end of a repetition, not the beginning of the next.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/portable.h"
#include "gpu/primitives/fixed.h"

namespace voxeld::gpu {

VOXELD_HD inline uint32_t HalfSide(uint32_t side) { return side > 1 ? side / 2 : 1; }

// Returns the number of texels of all levels. The texels of a level are stored row by row, from the
// upper left, as 0x00RRGGBB.
VOXELD_HD inline uint64_t TexelCount(uint32_t width, uint32_t height) {
  uint64_t count = static_cast<uint64_t>(width) * height;
  while (width > 1 || height > 1) {
    width = HalfSide(width), height = HalfSide(height);
    count += static_cast<uint64_t>(width) * height;
  }
  return count;
}

// The place of a triangle on one level.
struct TexturePlace {
  const uint32_t* texels = nullptr;  // null: no texture
  uint32_t width = 0, height = 0;
  float at[3][2] = {};  // of the corners

  // Chooses the level for a triangle with these corners.
  VOXELD_HD void ChooseLevel(const Int3 (&corners)[3]) {
    double edge[2][3], voxels = 0;  // twice the area
    for (int a = 0; a < 3; ++a) {
      for (int i = 0; i < 2; ++i) {
        edge[i][a] = static_cast<double>(corners[i + 1][a] - corners[0][a]) / kUnitsPerVoxel;
      }
    }
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      voxels = Max(voxels, Abs(edge[0][b] * edge[1][c] - edge[0][c] * edge[1][b]));
    }
    const double u1 = static_cast<double>(at[1][0]) - static_cast<double>(at[0][0]),
                 v1 = static_cast<double>(at[1][1]) - static_cast<double>(at[0][1]),
                 u2 = static_cast<double>(at[2][0]) - static_cast<double>(at[0][0]),
                 v2 = static_cast<double>(at[2][1]) - static_cast<double>(at[0][1]);
    const double share = Abs(u1 * v2 - v1 * u2);
    while (width > 1 || height > 1) {
      if (!(share * width * height > 2 * voxels)) return;
      texels += static_cast<size_t>(width) * height;
      width = HalfSide(width), height = HalfSide(height);
    }
  }

  VOXELD_HD uint32_t Texel(double u, double v) const {
    return texels[static_cast<size_t>(Row(v, height)) * width + Row(u, width)];
  }
  VOXELD_HD uint32_t OfCorner(int i) const {
    return Texel(static_cast<double>(at[i][0]), static_cast<double>(at[i][1]));
  }

 private:
  // Returns the index of the texel among `count` along a side.
  VOXELD_HD static uint32_t Row(double place, uint32_t count) {
    constexpr double kFar = 1e12;  // also for NaN
    if (!(place > -kFar && place < kFar)) return 0;
    double whole = static_cast<double>(static_cast<int64_t>(place));
    if (whole > place || (whole == place && place > 0)) --whole;
    const uint32_t row = static_cast<uint32_t>((place - whole) * count);
    return Min(row, count - 1);
  }
};

}  // namespace voxeld::gpu
