#include "gpu/slice/light_plan.h"

#include <algorithm>

#include "display/geometry/density.h"
#include "gpu/slice/blue_noise.h"

namespace voxeld::gpu {
namespace {

// Returns the least, over all pixels, of the greatest threshold of a pixel's parts.
uint32_t WorstThreshold(display::Dither dither, uint32_t parts) {
  uint32_t worst = kFullLight;
  const auto look = [&](auto threshold_of) {
    uint32_t greatest = 0;
    for (uint32_t part = 0; part < parts; ++part) greatest = std::max(greatest, threshold_of(part));
    worst = std::min(worst, greatest);
  };
  if (dither == display::Dither::kBlueNoise) {
    for (uint32_t rank = 0; rank < kNoiseRanks; ++rank) {
      look([&](uint32_t part) { return NoiseThreshold(rank, 0, part, parts); });
    }
    return worst;
  }
  for (uint32_t pixel = 0; pixel < 64; ++pixel) {
    look([&](uint32_t part) { return Threshold(dither, pixel % 8, pixel / 8, part, parts); });
  }
  return worst;
}

}  // namespace

uint16_t LeastFactor(const display::FrameLayout& layout, const display::Tone& tone) {
  const bool projector = layout.format == display::PixelFormat::kPlanes24;
  const uint32_t parts = static_cast<uint32_t>(layout.sub_frames) *
                         (projector ? static_cast<uint32_t>(display::kProjectorParts) : 1u);
  const uint32_t below = kFullLight - WorstThreshold(tone.dither, parts);
  const Levels levels = LevelsOf(layout.format, static_cast<uint32_t>(layout.bits_per_channel()));
  const uint32_t of[3] = {levels.r, levels.g, levels.b};
  const uint64_t brightest = std::max({tone.lut[0][255], tone.lut[1][255], tone.lut[2][255]});
  uint64_t least = kFullLight;
  for (size_t c = 0; c < 3; ++c) {
    if (tone.lut[c][255] == 0) continue;
    // The light if it were not dimmed.
    const uint64_t white = tone.lut[c][255] * uint64_t{kFullLight} / brightest;
    const uint64_t light = (below + of[c] - 2) / (of[c] - 1);
    // Dim rounds, so one whole step more is enough.
    least = std::min(least, (light * kFullLight + white - 1) / white + 1);
  }
  return static_cast<uint16_t>(std::clamp<uint64_t>(least, 1, kFullLight));
}

LightPlan LightPlan::WithoutFactors(const display::Tone& tone) {
  LightPlan plan;
  for (const display::Tone::Curve& curve : tone.lut) {
    plan.curves.insert(plan.curves.end(), curve.begin(), curve.end());
  }
  if (tone.dither == display::Dither::kBlueNoise) {
    plan.noise.assign(BlueNoise().begin(), BlueNoise().end());
  }
  return plan;
}

LightPlan LightPlan::Of(const display::FootprintTable& table, const display::VoxelGrid& grid,
                        const display::FrameLayout& layout, const display::Tone& tone) {
  LightPlan plan = WithoutFactors(tone);
  if (tone.density == display::Density::kEven) {
    plan.factors = display::EvenFactors(table, grid, LeastFactor(layout, tone));
  }
  return plan;
}

std::shared_ptr<const LightPlan> LightPlanner::Of(const display::FootprintTable& table,
                                                  const display::Geometry& geometry,
                                                  const display::FrameLayout& layout,
                                                  const display::Tone& tone) {
  const uint16_t least = LeastFactor(layout, tone);
  const bool same = even_ && even_->geometry == geometry && even_->sampling == tone.sampling &&
                    even_->least == least;
  if (tone.density == display::Density::kEven && !same) {
    even_ = {geometry, tone.sampling, least, display::EvenFactors(table, geometry.grid, least)};
  }
  auto plan = std::make_shared<LightPlan>(LightPlan::WithoutFactors(tone));
  if (tone.density == display::Density::kEven) plan->factors = even_->factors;
  return plan;
}

Finish LightPlan::finish(const display::FrameLayout& layout, const display::Tone& tone) const {
  Finish finish;
  finish.format = layout.format;
  finish.dither = tone.dither;
  finish.bits = static_cast<uint32_t>(layout.bits_per_channel());
  finish.sub_frames = static_cast<uint32_t>(layout.sub_frames);
  finish.curves = curves.data();
  finish.noise = noise.empty() ? nullptr : noise.data();
  finish.factors = factors.empty() ? nullptr : factors.data();
  return finish;
}

}  // namespace voxeld::gpu
