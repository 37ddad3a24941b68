// Converts a pixel's colour to levels: light by its channels' curves, dimmed where pixels are
// dense, dithered to levels. Host and device; the definition for every engine.
#pragma once

#include <cstdint>

#include "display/api/frame_layout.h"
#include "gpu/portable.h"
#include "gpu/slice/pack.h"
#include "gpu/slice/quantize.h"

namespace voxeld::gpu {

// Linear, 0 to 65535.
struct Light {
  uint32_t r, g, b;
};

inline constexpr uint32_t kFullLight = 65535;

VOXELD_HD inline uint32_t Dim(uint32_t light, uint32_t factor) {
  return (light * factor + kFullLight / 2) / kFullLight;
}

// Tables of a target (light_plan.h). The arrays must outlive it.
struct Finish {
  display::PixelFormat format = display::PixelFormat::kRgb888;
  display::Dither dither = display::Dither::kNone;
  uint32_t bits = 8;  // per channel
  uint32_t sub_frames = 1;
  const uint16_t* curves = nullptr;  // 256 each of red, green and blue
  const uint16_t* noise = nullptr;   // kNoiseRanks of kBlueNoise, else null
  const uint16_t* factors =
      nullptr;  // for each outer row of the footprints (slice·columns + column); null: all are full

  VOXELD_HD Light LightOf(uint32_t rgb) const {
    return {curves[rgb >> 16], curves[256 + (rgb >> 8 & 0xFF)], curves[512 + (rgb & 0xFF)]};
  }

  // Returns the light of colour 0x00RRGGBB in a pixel of that outer row.
  VOXELD_HD Light LightAt(uint32_t rgb, size_t row) const {
    const Light full = LightOf(rgb);
    if (factors == nullptr) return full;
    const uint32_t factor = factors[row];
    return {Dim(full.r, factor), Dim(full.g, factor), Dim(full.b, factor)};
  }

  VOXELD_HD uint32_t ThresholdOf(uint32_t slice, uint32_t u, uint32_t v, uint32_t part,
                                 uint32_t parts) const {
    if (dither != display::Dither::kBlueNoise) return Threshold(dither, u, v, part, parts);
    return NoiseThreshold(noise[v % kNoiseSide * kNoiseSide + u % kNoiseSide], slice, part, parts);
  }

  VOXELD_HD Levels LevelsAt(Light light, uint32_t slice, uint32_t u, uint32_t v,
                            uint32_t sub) const {
    if (format == display::PixelFormat::kPlanes24) {
      constexpr uint32_t kParts = display::kProjectorParts;
      Levels q = {0, 0, 0};
      for (uint32_t t = 0; t < kParts; ++t) {
        const uint32_t threshold = ThresholdOf(slice, u, v, sub * kParts + t, sub_frames * kParts);
        q.r |= Quantize(light.r, 2, threshold) << t;
        q.g |= Quantize(light.g, 2, threshold) << t;
        q.b |= Quantize(light.b, 2, threshold) << t;
      }
      return q;
    }
    const Levels levels = LevelsOf(format, bits);
    const uint32_t threshold = ThresholdOf(slice, u, v, sub, sub_frames);
    return {Quantize(light.r, levels.r, threshold), Quantize(light.g, levels.g, threshold),
            Quantize(light.b, levels.b, threshold)};
  }
};

}  // namespace voxeld::gpu
