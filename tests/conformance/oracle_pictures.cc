// Draws pictures of a dense volume, pixel by pixel: a footprint's colour, its light, dithered, in
// the display's bytes.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "display/geometry/density.h"
#include "gpu/slice/blue_noise.h"
#include "gpu/slice/light_plan.h"
#include "tests/conformance/oracle.h"
#include "tests/conformance/oracle_footprints.h"

namespace voxeld::gpu::conformance {
namespace {

constexpr int kBayer[8][8] = {{0, 32, 8, 40, 2, 34, 10, 42},  {48, 16, 56, 24, 50, 18, 58, 26},
                              {12, 44, 4, 36, 14, 46, 6, 38}, {60, 28, 52, 20, 62, 30, 54, 22},
                              {3, 35, 11, 43, 1, 33, 9, 41},  {51, 19, 59, 27, 49, 17, 57, 25},
                              {15, 47, 7, 39, 13, 45, 5, 37}, {63, 31, 55, 23, 61, 29, 53, 21}};

uint32_t PixelOf(const DenseVolume& volume, const OracleFootprints& footprints, int32_t slice,
                 int32_t u, int32_t v, display::Sampling sampling) {
  uint32_t best = 0, red = 0, green = 0, blue = 0;
  for (const OracleVoxel& voxel : footprints.Of(slice, u, v)) {
    const uint32_t rgb = volume.rgb[volume.Index(voxel.x, voxel.y, voxel.z)], w = voxel.weight;
    if (Interleaved(rgb) > Interleaved(best)) best = rgb;
    red = std::max(red, (w * (rgb >> 16) + 127) / 255);
    green = std::max(green, (w * (rgb >> 8 & 255) + 127) / 255);
    blue = std::max(blue, (w * (rgb & 255) + 127) / 255);
  }
  return sampling == display::Sampling::kMax ? best : red << 16 | green << 8 | blue;
}

// A pixel, and the part of the time in which it is shown.
struct Moment {
  int32_t slice = 0;
  int u = 0, v = 0;
  int part = 0, parts = 1;
};

// Converts light to levels.
class Toner {
 public:
  explicit Toner(const Target& target) : target_(target) {
    if (target.tone.dither == display::Dither::kBlueNoise)
      noise_.assign(BlueNoise().begin(), BlueNoise().end());
    if (target.tone.density == display::Density::kEven) {
      table_ = display::BuildFootprints(target.geometry, target.tone.sampling);
      factors_ = display::EvenFactors(table_, target.geometry.grid,
                                      LeastFactor(target.layout, target.tone));
    }
  }

  uint32_t Level(uint32_t rgb, size_t channel, uint32_t levels, const Moment& at) const {
    uint64_t light = target_.tone.lut[channel][rgb >> (16 - 8 * channel) & 255];
    if (!factors_.empty()) light = (light * FactorOf(at) * 2 + 65535) / (2 * 65535);
    return static_cast<uint32_t>((light * (levels - 1) + Threshold(at)) / 65535);
  }

 private:
  uint64_t FactorOf(const Moment& at) const {
    const int column = table_.flat_row == 0 ? at.u : at.v * table_.flat_row + at.u;
    return factors_[static_cast<size_t>(at.slice) * static_cast<size_t>(table_.width) +
                    static_cast<size_t>(column)];
  }

  uint64_t Threshold(const Moment& at) const {
    switch (target_.tone.dither) {
      case display::Dither::kNone:
        return 32767;
      case display::Dither::kOrdered: {
        const int b = (kBayer[at.v % 8][at.u % 8] + at.part * 64 / at.parts) % 64;
        return static_cast<uint64_t>((2 * b + 1) * 65535 / 128);
      }
      case display::Dither::kBlueNoise: {
        // The next slice is shifted by the golden section of 4096 ranks.
        const int64_t rank = noise_[static_cast<size_t>(at.v % 64 * 64 + at.u % 64)];
        const int64_t b = (rank + int64_t{at.slice} * 2531 + at.part * 4096 / at.parts) % 4096;
        return static_cast<uint64_t>((2 * b + 1) * 65535 / 8192);
      }
    }
    return 0;
  }

  const Target& target_;
  std::vector<uint16_t> noise_, factors_;
  display::FootprintTable table_;
};

// Writes bits to their places in pictures.
class Painter {
 public:
  Painter(const Target& target, std::vector<std::byte>& bytes)
      : layout_(target.layout),
        toner_(target),
        bytes_(bytes),
        width_(static_cast<size_t>(layout_.width)),
        height_(static_cast<size_t>(layout_.height)) {}

  // Writes a pixel's colour in sub-frame at.part of at.parts.
  void Paint(uint32_t rgb, const Moment& at) {
    picture_ = (static_cast<size_t>(at.slice) * static_cast<size_t>(at.parts) +
                static_cast<size_t>(at.part)) *
               layout_.bytes_per_slice();
    const size_t u = static_cast<size_t>(at.u), v = static_cast<size_t>(at.v);
    const size_t bits = static_cast<size_t>(layout_.bits_per_channel());
    const size_t pixel = v * width_ + u;
    for (size_t c = 0; c < 3; ++c) {
      const auto level = [&](uint32_t levels) { return toner_.Level(rgb, c, levels, at); };
      switch (layout_.format) {
        case display::PixelFormat::kRgb888:
          Set(pixel * 3 + c, level(1u << bits));
          break;
        case display::PixelFormat::kRgb332:
          Set(pixel, c == 0 ? level(8) * 32 : c == 1 ? level(8) * 4 : level(4));
          break;
        case display::PixelFormat::kBitPlanes: {
          const size_t row = (width_ + 7) / 8;
          for (size_t bit = 0; bit < bits; ++bit) {
            const size_t plane = (bits - 1 - bit) * 3 + c;
            Set((plane * height_ + v) * row + u / 8,
                (level(1u << bits) >> bit & 1) * (0x80u >> u % 8));
          }
          break;
        }
        case display::PixelFormat::kHub75:
          for (size_t bit = 0; bit < bits; ++bit) {
            const size_t half = height_ / 2;
            Set(((bits - 1 - bit) * half + v % half) * width_ + u,
                (level(1u << bits) >> bit & 1) << (c + (v >= half ? 3 : 0)));
          }
          break;
        case display::PixelFormat::kPlanes24:
          for (int t = 0; t < 8; ++t) {
            const Moment part = {at.slice, at.u, at.v, at.part * 8 + t, at.parts * 8};
            const size_t bit = static_cast<size_t>(t) * 3 + c;
            Set(pixel * 3 + bit / 8, toner_.Level(rgb, c, 2, part) << bit % 8);
          }
          break;
      }
    }
  }

 private:
  void Set(size_t at, uint32_t bits) { bytes_[picture_ + at] |= static_cast<std::byte>(bits); }

  const display::FrameLayout& layout_;
  const Toner toner_;
  std::vector<std::byte>& bytes_;
  const size_t width_, height_;
  size_t picture_ = 0;
};

}  // namespace

std::vector<std::byte> OraclePictures(const DenseVolume& volume, const Target& target) {
  const OracleFootprints footprints(target);
  const display::FrameLayout& layout = target.layout;
  std::vector<std::byte> bytes(layout.bytes());
  Painter painter(target, bytes);
  for (int32_t slice = 0; slice < layout.slices; ++slice) {
    for (int32_t v = 0; v < layout.height; ++v) {
      for (int32_t u = 0; u < layout.width; ++u) {
        const uint32_t rgb = PixelOf(volume, footprints, slice, u, v, target.tone.sampling);
        if (rgb == 0) continue;
        for (int32_t sub = 0; sub < layout.sub_frames; ++sub) {
          painter.Paint(rgb, {slice, u, v, sub, layout.sub_frames});
        }
      }
    }
  }
  return bytes;
}

}  // namespace voxeld::gpu::conformance
