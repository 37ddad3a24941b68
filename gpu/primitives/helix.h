// A line that winds around another line: a coil or, with two radii, on a cone.
//
// Guarantee: before it is cut, the curve is accurate to 2·10⁻⁴ of its greater radius, and begins
// and ends at the exact points.
#pragma once

#include "gpu/curves/spans.h"

namespace voxeld::gpu {

struct Helix {
  implicit::Vector start, end;  // must differ
  double radius = 1, end_radius = 1;
  double turns = 1;       // right-handed; left-handed if negative
  implicit::Vector u, v;  // across the axis (FrameOf)

  void Make(Spans& spans) const {
    const double sweep = 2 * std::numbers::pi * turns;
    const implicit::Vector rise = (1 / sweep) * (end - start);
    const double growth = (end_radius / radius - 1) / sweep;
    spans.Spiral(start, radius * u, radius * v, 0, sweep, rise, growth);
  }
};

}  // namespace voxeld::gpu
