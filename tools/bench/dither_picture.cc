// voxel-dither OUT.png: draws one picture that shows dither of a ramp at one bit, and its spectrum.
// From the top: the ramp; ordered dither; blue noise; blue noise of the next slice. Below them is
// the power spectrum with 1/8, 1/4 and 1/2 of the pixels lit, ordered above and blue noise below.
// The constant part is in the middle; black means no power, and white means four times the power of
// randomly lit pixels.
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <vector>

#include "gpu/slice/blue_noise.h"
#include "gpu/slice/quantize.h"

namespace voxeld::gpu {
namespace {

constexpr uint32_t kSide = kNoiseSide, kWidth = 768, kRows = 64, kScale = 4;

using Ranks = std::array<uint16_t, kNoiseRanks>;

uint32_t ThresholdAt(const Ranks* noise, uint32_t u, uint32_t v, uint32_t slice) {
  if (noise == nullptr) return Threshold(display::Dither::kOrdered, u, v, 0, 1);
  return NoiseThreshold((*noise)[v % kSide * kSide + u % kSide], slice, 0, 1);
}

struct Picture {
  uint32_t width, height;
  std::vector<uint8_t> grey = std::vector<uint8_t>(size_t{width} * height, 40);
  uint8_t& at(uint32_t x, uint32_t y) { return grey[size_t{y} * width + x]; }
};

void PutRamp(Picture& picture, uint32_t top, const Ranks* noise, uint32_t slice) {
  for (uint32_t y = 0; y < kRows; ++y) {
    for (uint32_t x = 0; x < kWidth; ++x) {
      const uint32_t light = x * 65535 / (kWidth - 1);
      picture.at(x, top + y) = Quantize(light, 2, ThresholdAt(noise, x, y, slice)) != 0 ? 255 : 0;
    }
  }
}

void PutSpectrum(Picture& picture, uint32_t left, uint32_t top, const Ranks* noise,
                 uint32_t light) {
  std::vector<std::complex<double>> rows(size_t{kSide} * kSide);
  const auto turn = [](uint32_t n) {
    return std::polar(1.0, -2 * std::numbers::pi * (n % kSide) / kSide);
  };
  double lit = 0;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      if (Quantize(light, 2, ThresholdAt(noise, x, y, 0)) == 0) continue;
      ++lit;
      for (uint32_t f = 0; f < kSide; ++f) rows[size_t{y} * kSide + f] += turn(f * x);
    }
  }
  const double random = lit * (1 - lit / (kSide * kSide));
  for (uint32_t fy = 0; fy < kSide; ++fy) {
    for (uint32_t fx = 0; fx < kSide; ++fx) {
      std::complex<double> sum;
      for (uint32_t y = 0; y < kSide; ++y) sum += rows[size_t{y} * kSide + fx] * turn(fy * y);
      const double power = fx == 0 && fy == 0 ? 0 : std::norm(sum) / random;
      const auto grey = static_cast<uint8_t>(std::min(255.0, 255 * std::sqrt(power) / 2));
      const uint32_t x = left + (fx + kSide / 2) % kSide * kScale;
      const uint32_t y = top + (fy + kSide / 2) % kSide * kScale;
      for (uint32_t i = 0; i < kScale * kScale; ++i) {
        picture.at(x + i % kScale, y + i / kScale) = grey;
      }
    }
  }
}

int Write(const char* path) {
  const Ranks& noise = BlueNoise();
  constexpr uint32_t kTile = kSide * kScale, kGap = 8;
  Picture picture{kWidth, 4 * (kRows + kGap) + 2 * kTile + kGap};
  for (uint32_t y = 0; y < kRows; ++y) {
    for (uint32_t x = 0; x < kWidth; ++x) {
      picture.at(x, y) = static_cast<uint8_t>(x * 255 / (kWidth - 1));
    }
  }
  PutRamp(picture, kRows + kGap, nullptr, 0);
  PutRamp(picture, 2 * (kRows + kGap), &noise, 0);
  PutRamp(picture, 3 * (kRows + kGap), &noise, 1);
  const uint32_t top = 4 * (kRows + kGap);
  for (uint32_t i = 0; i < 3; ++i) {
    const uint32_t light = 65535 >> (3 - i);
    PutSpectrum(picture, i * kTile, top, nullptr, light);
    PutSpectrum(picture, i * kTile, top + kTile + kGap, &noise, light);
  }
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = picture.width;
  image.height = picture.height;
  image.format = PNG_FORMAT_GRAY;
  if (png_image_write_to_file(&image, path, 0, picture.grey.data(), 0, nullptr) == 0) {
    std::fprintf(stderr, "voxel-dither: %s: %s\n", path, image.message);
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace voxeld::gpu

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: voxel-dither OUT.png\n");
    return 2;
  }
  return voxeld::gpu::Write(argv[1]);
}
