// Shapes as lines, and as dots where those meet: the edges of shapes that have any; for round
// shapes, meridians and parallels 45° apart.
#pragma once

#include <numbers>
#include <vector>

#include "gpu/curves/spans.h"
#include "gpu/primitives/arrow.h"
#include "gpu/primitives/cone.h"
#include "gpu/primitives/disc.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/parallelepiped.h"
#include "gpu/primitives/patch.h"
#include "gpu/primitives/polygon.h"
#include "gpu/primitives/torus.h"

namespace voxeld::gpu {

struct WireFrame {
  Spans lines;
  std::vector<implicit::Vector> dots;

  void Add(const WireFrame& other) {
    lines.Add(other.lines);
    dots.insert(dots.end(), other.dots.begin(), other.dots.end());
  }
};

inline constexpr int kMeridians = 8;
inline constexpr double kMeridianStep = 2 * std::numbers::pi / kMeridians;

inline WireFrame WireFrameOf(const Parallelepiped& shape) {
  WireFrame frame;
  const auto corner = [&](int i) {
    implicit::Vector p = shape.center;
    for (int e = 0; e < 3; ++e) p = p + ((i >> e & 1) != 0 ? 0.5 : -0.5) * shape.edges[e];
    return p;
  };
  for (int i = 0; i < 8; ++i) {
    frame.dots.push_back(corner(i));
    for (int e = 0; e < 3; ++e) {
      if ((i >> e & 1) == 0) frame.lines.Line(corner(i), corner(i | 1 << e));
    }
  }
  return frame;
}

inline WireFrame WireFrameOf(const Ellipsoid& shape) {
  using implicit::Vector;
  WireFrame frame;
  const Vector x = {shape.radii.x, 0, 0}, y = {0, shape.radii.y, 0}, z = {0, 0, shape.radii.z};
  frame.dots = {shape.center + z, shape.center - z};
  for (int m = 0; m < kMeridians; ++m) {
    const Vector out = std::cos(m * kMeridianStep) * x + std::sin(m * kMeridianStep) * y;
    frame.lines.Arc(shape.center, z, out, 0, std::numbers::pi);
    for (int p = -1; p <= 1; ++p) {
      frame.dots.push_back(shape.center + std::cos(p * kMeridianStep) * out +
                           std::sin(p * kMeridianStep) * z);
    }
  }
  for (int p = -1; p <= 1; ++p) {
    const double wide = std::cos(p * kMeridianStep);
    frame.lines.Arc(shape.center + std::sin(p * kMeridianStep) * z, wide * x, wide * y, 0,
                    2 * std::numbers::pi);
  }
  return frame;
}

inline WireFrame WireFrameOf(const Torus& shape) {
  using implicit::Vector;
  WireFrame frame;
  const Vector z = {0, 0, shape.tube_radius};
  for (int m = 0; m < kMeridians; ++m) {
    const Vector out = {std::cos(m * kMeridianStep), std::sin(m * kMeridianStep), 0};
    const Vector middle = shape.center + shape.radius * out;
    frame.lines.Arc(middle, shape.tube_radius * out, z, 0, 2 * std::numbers::pi);
    const double up = std::sin(m * kMeridianStep) * shape.tube_radius;
    const double wide = shape.radius + std::cos(m * kMeridianStep) * shape.tube_radius;
    frame.lines.Arc(shape.center + Vector{0, 0, up}, {wide, 0, 0}, {0, wide, 0}, 0,
                    2 * std::numbers::pi);
    for (int p = 0; p < kMeridians; ++p) {
      frame.dots.push_back(middle + (std::cos(p * kMeridianStep) * shape.tube_radius) * out +
                           std::sin(p * kMeridianStep) * z);
    }
  }
  return frame;
}

inline WireFrame WireFrameOf(const Cone& shape) {
  using implicit::Vector;
  WireFrame frame;
  const Vector axis = shape.end - shape.start;
  const double length = implicit::Length(axis);
  const Vector unit = 1 / length * axis;
  Vector u, v;
  if (!FrameOf(axis, {1, 0, 0}, &u, &v)) FrameOf(axis, {0, 1, 0}, &u, &v);
  // With round ends, the mantle does not touch the spheres at their middles.
  const double fall = shape.round ? (shape.start_radius - shape.end_radius) / length : 0;
  const double slant = std::sqrt(std::max(0.0, 1 - fall * fall));
  const double tilt = std::asin(std::clamp(fall, -1.0, 1.0));
  const Vector middles[2] = {shape.start + (fall * shape.start_radius) * unit,
                             shape.end + (fall * shape.end_radius) * unit};
  const double radii[2] = {shape.start_radius * slant, shape.end_radius * slant};
  for (int end = 0; end < 2; ++end) {
    if (radii[end] > 0) {
      frame.lines.Arc(middles[end], radii[end] * u, radii[end] * v, 0, 2 * std::numbers::pi);
    } else {
      frame.dots.push_back(middles[end]);
    }
  }
  for (int m = 0; m < kMeridians; ++m) {
    const Vector out = std::cos(m * kMeridianStep) * u + std::sin(m * kMeridianStep) * v;
    frame.lines.Line(middles[0] + radii[0] * out, middles[1] + radii[1] * out);
    for (int end = 0; end < 2; ++end) {
      if (radii[end] > 0) frame.dots.push_back(middles[end] + radii[end] * out);
    }
    if (!shape.round) continue;
    const double quarter = std::numbers::pi / 2;
    frame.lines.Arc(shape.start, shape.start_radius * out, shape.start_radius * unit, tilt,
                    -quarter - tilt);
    frame.lines.Arc(shape.end, shape.end_radius * out, shape.end_radius * unit, tilt,
                    quarter - tilt);
  }
  if (shape.round) {
    frame.dots.push_back(shape.start - shape.start_radius * unit);
    frame.dots.push_back(shape.end + shape.end_radius * unit);
  }
  return frame;
}

inline WireFrame WireFrameOf(const Disc& shape) {
  using implicit::Vector;
  WireFrame frame;
  Vector u, v;
  if (!FrameOf(shape.normal, {1, 0, 0}, &u, &v)) FrameOf(shape.normal, {0, 1, 0}, &u, &v);
  for (const double radius : {shape.inner_radius, shape.radius}) {
    if (!(radius > 0)) {
      frame.dots.push_back(shape.center);
      continue;
    }
    frame.lines.Arc(shape.center, radius * u, radius * v, 0, 2 * std::numbers::pi);
    for (int m = 0; m < kMeridians; ++m) {
      const double angle = m * kMeridianStep;
      frame.dots.push_back(shape.center + (std::cos(angle) * radius) * u +
                           (std::sin(angle) * radius) * v);
    }
  }
  for (int m = 0; m < kMeridians; ++m) {
    const Vector out = std::cos(m * kMeridianStep) * u + std::sin(m * kMeridianStep) * v;
    frame.lines.Line(shape.center + shape.inner_radius * out, shape.center + shape.radius * out);
  }
  return frame;
}

inline WireFrame WireFrameOf(const Patch& shape) {
  WireFrame frame;
  frame.dots = {shape.corner, shape.corner + shape.u, shape.corner + shape.u + shape.v,
                shape.corner + shape.v};
  for (size_t i = 0; i < 4; ++i) frame.lines.Line(frame.dots[i], frame.dots[(i + 1) % 4]);
  return frame;
}

inline WireFrame WireFrameOf(const Polygon& shape) {
  WireFrame frame;
  frame.dots.assign(shape.points.begin(), shape.points.end());
  uint32_t begin = 0;
  for (const uint32_t end : shape.ends) {
    for (uint32_t i = begin; i < end; ++i) {
      frame.lines.Line(shape.points[i], shape.points[i + 1 < end ? i + 1 : begin]);
    }
    begin = end;
  }
  return frame;
}

inline WireFrame WireFrameOf(const Arrow& shape) {
  const double length = implicit::Length(shape.end - shape.start);
  const implicit::Vector neck =
      shape.end - (shape.head_length / length) * (shape.end - shape.start);
  WireFrame frame = WireFrameOf(Cone{neck, shape.end, shape.head_radius, 0});
  if (!(shape.head_length < length)) return frame;
  if (shape.shaft_radius > 0) {
    frame.Add(WireFrameOf(Cone{shape.start, neck, shape.shaft_radius, shape.shaft_radius}));
  } else {
    frame.lines.Line(shape.start, neck);
    frame.dots.push_back(shape.start);
  }
  return frame;
}

}  // namespace voxeld::gpu
