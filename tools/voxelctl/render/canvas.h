// Combines splats and lines: light in floating point, with depth.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Linear light; 1 is full.
struct Light {
  float r = 0, g = 0, b = 0;
};

// A splat's shape on the screen: the ellipse of d with dᵀ·C⁻¹·d ≤ 1, C = (xx xy; xy yy).
struct Ellipse {
  double x = 0, y = 0;
  double xx = 1, xy = 0, yy = 1;
};

// Two layers: the nearest surface, and a glow of everything along the line of sight, as in a
// display without occlusion. Not thread-safe.
class Canvas {
 public:
  Canvas(int width, int height);

  // Adds a splat. The nearest splat of a pixel is its surface; each adds to the glow, with a soft
  // edge, weighted by `weight`.
  void Splat(const Ellipse& shape, float depth, const Light& light, float weight);

  // Draws a line `thickness` elements wide over what is behind it; a nearer surface leaves it
  // faintly visible.
  void Line(double x0, double y0, float depth0, double x1, double y1, float depth1,
            double thickness, const Light& light);

  // Combines both layers, averages factor·factor elements per pixel, and encodes as sRGB.
  Image Develop(int factor) const;

 private:
  struct Element {
    Light surface;
    float depth = 2;  // farther than everything
    Light glow;       // weighted sum
    float glow_weight = 0;
    Light line;
  };
  Light Value(const Element& element) const;

  int width_, height_;
  std::vector<Element> elements_;
};

}  // namespace voxeld::voxelctl
