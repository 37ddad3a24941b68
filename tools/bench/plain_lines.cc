#include "tools/bench/plain_lines.h"

#include <algorithm>
#include <cmath>

namespace voxeld::bench {

uint64_t DrawPlainLines(std::span<const float> positions, std::span<const uint32_t> colors,
                        const int32_t size[3], uint32_t* dense) {
  const auto width = static_cast<size_t>(size[0]), height = static_cast<size_t>(size[1]);
  uint64_t voxels = 0;
  for (size_t i = 0; i < colors.size(); ++i) {
    const float* const p = positions.data() + i * 6;
    const float dx = p[3] - p[0], dy = p[4] - p[1], dz = p[5] - p[2];
    const auto steps =
        static_cast<int32_t>(std::max({std::abs(dx), std::abs(dy), std::abs(dz)}) + 0.5f);
    const float part = steps > 0 ? 1.0f / static_cast<float>(steps) : 0.0f;
    // Positions count from corners of voxels, so the nearest centre is half a voxel down.
    const float x0 = p[0] - 0.5f, y0 = p[1] - 0.5f, z0 = p[2] - 0.5f;
    for (int32_t k = 0; k <= steps; ++k) {
      const float t = static_cast<float>(k) * part;
      const auto x = static_cast<size_t>(std::floor(x0 + dx * t + 0.5f));
      const auto y = static_cast<size_t>(std::floor(y0 + dy * t + 0.5f));
      const auto z = static_cast<size_t>(std::floor(z0 + dz * t + 0.5f));
      dense[(z * height + y) * width + x] = colors[i];
    }
    voxels += static_cast<uint64_t>(steps) + 1;
  }
  return voxels;
}

}  // namespace voxeld::bench
