#include "display/drivers/fadecandy/lut.h"

#include <algorithm>
#include <cmath>

namespace voxeld::display::fadecandy {
namespace {

double Light(const ColorCurve& curve, double x) {
  if (x * curve.slope <= curve.cutoff) return x * curve.slope;
  const double rest = 1 - curve.cutoff;
  // Negative just beyond the linear part if the slope is above 1.
  const double beyond = std::max(0.0, x - curve.slope * curve.cutoff);
  return curve.cutoff + std::pow(beyond / rest, curve.gamma) * rest;
}

}  // namespace

Lut MakeLut(const ColorCurve& curve, double brightness) {
  Lut lut;
  for (size_t channel = 0; channel < 3; ++channel) {
    for (size_t i = 0; i < kLutEntries; ++i) {
      const double x = static_cast<double>(i << 8) / 65535 * curve.white[channel];
      const double light = std::clamp(Light(curve, x) * brightness, 0.0, 1.0);
      lut[channel * kLutEntries + i] = static_cast<uint16_t>(std::lround(light * 65535));
    }
  }
  return lut;
}

}  // namespace voxeld::display::fadecandy
