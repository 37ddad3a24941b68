#include "gpu/slice/levels.h"

#include "gpu/slice/pack.h"
#include "gpu/slice/quantize.h"

namespace voxeld::gpu {
namespace {

constexpr uint32_t kThresholds = 64;

}  // namespace

LevelTables LevelTables::Of(const display::FrameLayout& layout, const display::Tone& tone) {
  const Levels levels = LevelsOf(layout.format, static_cast<uint32_t>(layout.bits_per_channel()));
  const uint32_t levels_of[3] = {levels.r, levels.g, levels.b};
  uint32_t thresholds[kThresholds] = {};  // by the matrix' value
  for (uint32_t v = 0; v < 8; ++v) {
    for (uint32_t u = 0; u < 8; ++u) {
      thresholds[Bayer8(u, v)] = Threshold(tone.dither, u, v, 0, 1);
    }
  }
  LevelTables tables;
  for (size_t channel = 0; channel < 3; ++channel) {
    for (uint32_t c = 0; c < 256; ++c) {
      const uint32_t base = Quantize(tone.lut[channel][c], levels_of[channel], thresholds[0]);
      uint32_t rise = 0;
      for (const uint32_t threshold : thresholds) {
        rise += Quantize(tone.lut[channel][c], levels_of[channel], threshold) - base;
      }
      tables.base[channel][c] = static_cast<uint8_t>(base);
      tables.rise[channel][c] = static_cast<uint8_t>(rise);
    }
  }
  return tables;
}

LevelTables LevelTables::OfRgb332(const display::FrameLayout& layout, const display::Tone& tone) {
  constexpr int kShift[3] = {5, 2, 0};
  LevelTables tables = Of(layout, tone);
  for (size_t channel = 0; channel < 3; ++channel) {
    for (uint8_t& base : tables.base[channel]) base = static_cast<uint8_t>(base << kShift[channel]);
  }
  return tables;
}

uint64_t DitherColumn(uint32_t u, uint32_t sub, uint32_t sub_frames) {
  uint64_t column = 0;
  for (uint32_t v = 0; v < 8; ++v) {
    const uint32_t b = (Bayer8(u, v) + sub * kThresholds / sub_frames) % kThresholds;
    column |= uint64_t{kThresholds - 1 - b} << (8 * v);
  }
  return column;
}

}  // namespace voxeld::gpu
