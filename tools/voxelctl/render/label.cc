#include "tools/voxelctl/render/label.h"

#include <algorithm>
#include <cmath>

namespace voxeld::voxelctl {
namespace {

constexpr double kShade = 208, kHalfWidth = 0.9;

// Draws a stroke: pixels near it are blended by the share that it covers.
void DrawStroke(double x0, double y0, double x1, double y1, Image& image) {
  const double dx = x1 - x0, dy = y1 - y0, length2 = std::max(1e-9, dx * dx + dy * dy);
  const auto clamp = [](double v, int size) {
    return std::clamp(static_cast<int>(v), 0, size - 1);
  };
  const int left = clamp(std::min(x0, x1) - 2, image.width),
            right = clamp(std::max(x0, x1) + 2, image.width);
  const int top = clamp(std::min(y0, y1) - 2, image.height),
            bottom = clamp(std::max(y0, y1) + 2, image.height);
  for (int v = top; v <= bottom; ++v) {
    for (int u = left; u <= right; ++u) {
      const double px = u + 0.5 - x0, py = v + 0.5 - y0;
      const double t = std::clamp((px * dx + py * dy) / length2, 0.0, 1.0);
      const double cover =
          std::clamp(kHalfWidth + 0.5 - std::hypot(px - t * dx, py - t * dy), 0.0, 1.0);
      uint8_t* const pixel = &image.rgb[(static_cast<size_t>(v) * static_cast<size_t>(image.width) +
                                         static_cast<size_t>(u)) *
                                        3];
      for (int c = 0; c < 3; ++c) {
        pixel[c] = static_cast<uint8_t>(std::max<double>(pixel[c], cover * kShade));
      }
    }
  }
}

}  // namespace

void DrawLabel(const text::StrokeFont& font, std::string_view ascii, double x, double y,
               double height, Image& image) {
  const text::StrokeFont::Line line = font.Lay(ascii);
  for (const text::Stroke& stroke : line.strokes) {
    for (size_t i = 0; i + 1 < stroke.size(); ++i) {
      const auto at = [&](size_t p, double* u, double* v) {
        *u = x + static_cast<double>(stroke[p].x) * height;
        *v = y - static_cast<double>(stroke[p].y) * height;
      };
      double x0, y0, x1, y1;
      at(i, &x0, &y0);
      at(i + 1, &x1, &y1);
      DrawStroke(x0, y0, x1, y1, image);
    }
  }
}

}  // namespace voxeld::voxelctl
