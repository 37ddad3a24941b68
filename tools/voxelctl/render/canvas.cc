#include "tools/voxelctl/render/canvas.h"

#include <algorithm>
#include <cmath>

namespace voxeld::voxelctl {
namespace {

constexpr Light kBackground = {0.0035f, 0.0045f, 0.0075f};
constexpr float kSurfaceShare = 0.80f;
constexpr float kGlowShare = 0.42f;
constexpr float kGlowDensity = 0.10f;  // how quickly layers of glow become opaque
constexpr double kGlowReach = 1.9;     // in sizes of a splat
constexpr float kLineBehind = 0.25f;

uint8_t Encode(float linear) {
  const float v = std::clamp(linear, 0.0f, 1.0f);
  const float s = v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f;
  return static_cast<uint8_t>(std::lround(s * 255));
}

void AddScaled(Light* sum, const Light& light, float factor) {
  sum->r += light.r * factor;
  sum->g += light.g * factor;
  sum->b += light.b * factor;
}

}  // namespace

Canvas::Canvas(int width, int height)
    : width_(width),
      height_(height),
      elements_(static_cast<size_t>(width) * static_cast<size_t>(height)) {}

void Canvas::Splat(const Ellipse& e, float depth, const Light& light, float weight) {
  const double determinant = e.xx * e.yy - e.xy * e.xy;
  if (!(determinant > 1e-12)) return;
  const double ixx = e.yy / determinant, ixy = -e.xy / determinant, iyy = e.xx / determinant;
  const double reach_x = std::sqrt(e.xx) * kGlowReach, reach_y = std::sqrt(e.yy) * kGlowReach;
  const int x0 = std::max(0, static_cast<int>(std::floor(e.x - reach_x)));
  const int x1 = std::min(width_ - 1, static_cast<int>(std::ceil(e.x + reach_x)));
  const int y0 = std::max(0, static_cast<int>(std::floor(e.y - reach_y)));
  const int y1 = std::min(height_ - 1, static_cast<int>(std::ceil(e.y + reach_y)));
  constexpr double kGlowEdge = kGlowReach * kGlowReach;
  for (int y = y0; y <= y1; ++y) {
    const double dy = y + 0.5 - e.y;
    Element* row = elements_.data() + static_cast<size_t>(y) * static_cast<size_t>(width_);
    for (int x = x0; x <= x1; ++x) {
      const double dx = x + 0.5 - e.x;
      const double q = ixx * dx * dx + 2 * ixy * dx * dy + iyy * dy * dy;
      if (q >= kGlowEdge) continue;
      Element& element = row[x];
      const auto fall = static_cast<float>(1 - q / kGlowEdge);
      const float w = weight * fall * fall;
      AddScaled(&element.glow, light, w);
      element.glow_weight += w;
      if (q <= 1 && depth < element.depth) {
        element.depth = depth;
        element.surface = light;
      }
    }
  }
}

void Canvas::Line(double x0, double y0, float depth0, double x1, double y1, float depth1,
                  double thickness, const Light& light) {
  const double reach = thickness / 2 + 1;
  const int left = std::max(0, static_cast<int>(std::floor(std::min(x0, x1) - reach)));
  const int right = std::min(width_ - 1, static_cast<int>(std::ceil(std::max(x0, x1) + reach)));
  const int top = std::max(0, static_cast<int>(std::floor(std::min(y0, y1) - reach)));
  const int bottom = std::min(height_ - 1, static_cast<int>(std::ceil(std::max(y0, y1) + reach)));
  const double dx = x1 - x0, dy = y1 - y0;
  const double length2 = std::max(dx * dx + dy * dy, 1e-9);
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const double px = x + 0.5 - x0, py = y + 0.5 - y0;
      const double t = std::clamp((px * dx + py * dy) / length2, 0.0, 1.0);
      const double away = std::hypot(px - t * dx, py - t * dy);
      auto cover = static_cast<float>(std::clamp(thickness / 2 + 0.5 - away, 0.0, 1.0));
      if (cover <= 0) continue;
      Element& element =
          elements_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
      if (depth0 + static_cast<float>(t) * (depth1 - depth0) > element.depth) cover *= kLineBehind;
      element.line.r = std::max(element.line.r, light.r * cover);
      element.line.g = std::max(element.line.g, light.g * cover);
      element.line.b = std::max(element.line.b, light.b * cover);
    }
  }
}

Light Canvas::Value(const Element& element) const {
  Light value = kBackground;
  AddScaled(&value, element.surface, kSurfaceShare);
  if (element.glow_weight > 0) {
    const float opacity = 1 - std::exp(-kGlowDensity * element.glow_weight);
    AddScaled(&value, element.glow, kGlowShare * opacity / element.glow_weight);
  }
  AddScaled(&value, element.line, 1);
  return {std::min(value.r, 1.0f), std::min(value.g, 1.0f), std::min(value.b, 1.0f)};
}

Image Canvas::Develop(int factor) const {
  Image image{.width = width_ / factor, .height = height_ / factor, .rgb = {}};
  image.rgb.reserve(static_cast<size_t>(image.width) * static_cast<size_t>(image.height) * 3);
  const float share = 1.0f / static_cast<float>(factor * factor);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      Light sum;
      for (int j = 0; j < factor; ++j) {
        const size_t row = static_cast<size_t>(y * factor + j) * static_cast<size_t>(width_);
        for (int i = 0; i < factor; ++i) {
          AddScaled(&sum, Value(elements_[row + static_cast<size_t>(x * factor + i)]), share);
        }
      }
      image.rgb.insert(image.rgb.end(), {Encode(sum.r), Encode(sum.g), Encode(sum.b)});
    }
  }
  return image;
}

}  // namespace voxeld::voxelctl
