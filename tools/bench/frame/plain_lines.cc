#include "tools/bench/frame/plain_lines.h"

namespace voxeld::bench::frame {

void DrawPlainLines(const float* positions, const uint32_t* colors, size_t begin, size_t end,
                    int nx, int ny, uint32_t* volume) {
  for (size_t line = begin; line < end; ++line) {
    const float* s = positions + line * 6;
    const float* e = s + 3;
    float steps = 0;
    for (int a = 0; a < 3; ++a) {
      const float distance = __builtin_fabsf(__builtin_floorf(e[a]) - __builtin_floorf(s[a]));
      steps = distance > steps ? distance : steps;
    }
    const float scale = steps > 0 ? 1 / steps : 0;
    // Voxel centres have integer coordinates here, so rounding is floor(p + ½).
    const float x0 = s[0] - 0.5F, y0 = s[1] - 0.5F, z0 = s[2] - 0.5F;
    const float dx = (e[0] - s[0]) * scale, dy = (e[1] - s[1]) * scale, dz = (e[2] - s[2]) * scale;
    const uint32_t color = colors[line * 2];
    const int count = static_cast<int>(steps);
    for (int k = 0; k <= count; ++k) {
      const float at = static_cast<float>(k);
      const auto x = static_cast<int>(__builtin_floorf(x0 + dx * at + 0.5F));
      const auto y = static_cast<int>(__builtin_floorf(y0 + dy * at + 0.5F));
      const auto z = static_cast<int>(__builtin_floorf(z0 + dz * at + 0.5F));
      __atomic_store_n(volume + static_cast<ptrdiff_t>(z * ny + y) * nx + x, color,
                       __ATOMIC_RELAXED);
    }
  }
}

}  // namespace voxeld::bench::frame
