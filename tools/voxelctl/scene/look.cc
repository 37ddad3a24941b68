#include "tools/voxelctl/scene/look.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace voxeld::voxelctl {
namespace {

constexpr int kDarkest = 44;  // of the brightest channel

// The light comes from the upper left in front (x right, y away, z up); a unit vector.
constexpr Point3 kToLight = {-0.3651, -0.6390, 0.6770};
constexpr double kShadow = 0.30;

constexpr std::array<Rgb, 4> kSurfaceColors = {
    {{150, 200, 255}, {255, 190, 110}, {150, 235, 160}, {240, 150, 220}}};
constexpr std::array<Rgb, 4> kLineColors = {
    {{80, 210, 255}, {255, 170, 90}, {130, 240, 140}, {235, 140, 235}}};
constexpr std::array<Rgb, 4> kPointColors = {
    {{255, 232, 190}, {140, 210, 255}, {170, 255, 170}, {255, 160, 200}}};

Rgb DefaultColor(Kind kind, size_t model) {
  switch (kind) {
    case Kind::kTriangles:
      return kSurfaceColors[model % kSurfaceColors.size()];
    case Kind::kSegments:
      return kLineColors[model % kLineColors.size()];
    case Kind::kPoints:
      return kPointColors[model % kPointColors.size()];
  }
  return {255, 255, 255};
}

Rgb Lift(const Rgb& c) {
  const int brightest = std::max({c.r, c.g, c.b});
  if (brightest >= kDarkest) return c;
  if (brightest == 0) return {kDarkest, kDarkest, kDarkest};
  const auto lifted = [&](uint8_t v) { return static_cast<uint8_t>(v * kDarkest / brightest); };
  return {lifted(c.r), lifted(c.g), lifted(c.b)};
}

Rgb Shade(const Rgb& c, const Point3& n) {
  if (n == Point3{}) return c;
  const double facing = 0.5 + 0.5 * (n.x * kToLight.x + n.y * kToLight.y + n.z * kToLight.z);
  const double light = kShadow + (1 - kShadow) * std::pow(std::clamp(facing, 0.0, 1.0), 1.4);
  const auto lit = [&](uint8_t v) {
    return static_cast<uint8_t>(std::min(255.0, v * light + 0.5));
  };
  return {lit(c.r), lit(c.g), lit(c.b)};
}

// Returns each edge of the triangles once.
std::vector<uint32_t> Edges(const std::vector<uint32_t>& triangles) {
  std::vector<std::pair<uint32_t, uint32_t>> edges;
  edges.reserve(triangles.size());
  for (size_t t = 0; t + 3 <= triangles.size(); t += 3) {
    for (size_t e = 0; e < 3; ++e) {
      edges.push_back(std::minmax({triangles[t + e], triangles[t + (e + 1) % 3]}));
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  std::vector<uint32_t> indices;
  indices.reserve(edges.size() * 2);
  for (const auto& [from, to] : edges) {
    indices.push_back(from);
    indices.push_back(to);
  }
  return indices;
}

void ApplyFill(FillStyle fill, Part* part) {
  if (fill == FillStyle::kDots) {
    if (part->kind != Kind::kPoints) part->thickness = 0;
    part->kind = Kind::kPoints;
    part->indices.clear();
  } else if (fill == FillStyle::kLines && part->kind == Kind::kTriangles) {
    part->kind = Kind::kSegments;
    part->indices = Edges(part->indices);
  }
}

}  // namespace

void ApplyLook(std::span<Model> models, const LookOptions& options) {
  std::array<size_t, 3> seen = {};  // models that have parts of each kind
  for (size_t m = 0; m < models.size(); ++m) {
    const std::array<size_t, 3> number = seen;
    for (const Part& part : models[m].parts)
      seen[static_cast<size_t>(part.kind)] = number[static_cast<size_t>(part.kind)] + 1;
    for (Part& part : models[m].parts) {
      if (part.colors.empty()) {
        // A picture's own colours are multiplied by these.
        const Rgb plain = part.picture == kNoPicture
                              ? DefaultColor(part.kind, number[static_cast<size_t>(part.kind)])
                              : Rgb{255, 255, 255};
        part.colors.assign(part.positions.size(), plain);
      }
      const bool shaded = !options.flat && !models[m].lit_already && !part.normals.empty();
      for (size_t v = 0; v < part.colors.size(); ++v) {
        Rgb color = Lift(part.colors[v]);
        if (shaded) color = Shade(color, part.normals[v]);
        part.colors[v] = color;
      }
      part.normals = {};
      ApplyFill(options.fill, &part);
    }
  }
}

}  // namespace voxeld::voxelctl
