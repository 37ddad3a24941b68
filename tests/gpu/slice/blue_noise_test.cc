#include "gpu/slice/blue_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <vector>

#include "gpu/slice/quantize.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kSide = kNoiseSide;

TEST(BlueNoise, HasEachRankOnce) {
  std::array<uint16_t, kNoiseRanks> ranks = BlueNoise();
  std::sort(ranks.begin(), ranks.end());
  for (size_t i = 0; i < ranks.size(); ++i) ASSERT_EQ(ranks[i], i);
}

// The power of the picture of the pixels for which `lit` holds, by whole periods along x and y,
// relative to the same number of random pixels: 1 is white noise.
class Spectrum {
 public:
  template <typename Lit>
  explicit Spectrum(Lit lit) : power_(kSide * kSide) {
    std::vector<std::complex<double>> rows(kSide * kSide);
    double count = 0;
    for (size_t y = 0; y < kSide; ++y) {
      for (size_t x = 0; x < kSide; ++x) {
        if (!lit(y * kSide + x)) continue;
        ++count;
        for (size_t fx = 0; fx < kSide; ++fx) rows[y * kSide + fx] += Turn(fx * x);
      }
    }
    const double share = count / static_cast<double>(kSide * kSide);
    for (size_t fy = 0; fy < kSide; ++fy) {
      for (size_t fx = 0; fx < kSide; ++fx) {
        std::complex<double> sum;
        for (size_t y = 0; y < kSide; ++y) sum += rows[y * kSide + fx] * Turn(fy * y);
        power_[fy * kSide + fx] = std::norm(sum) / (count * (1 - share));
      }
    }
  }

  // Returns the mean over all directions from `low` to `high` periods, and in `most` the highest
  // power there.
  double Mean(double low, double high, double* most = nullptr) const {
    double sum = 0, greatest = 0;
    int64_t count = 0;
    for (size_t fy = 0; fy < kSide; ++fy) {
      for (size_t fx = 0; fx < kSide; ++fx) {
        const double x = fx < kSide / 2 ? double(fx) : double(fx) - kSide;
        const double y = fy < kSide / 2 ? double(fy) : double(fy) - kSide;
        const double f = std::hypot(x, y);
        if (f < low || f >= high) continue;
        sum += power_[fy * kSide + fx];
        greatest = std::max(greatest, power_[fy * kSide + fx]);
        ++count;
      }
    }
    if (most != nullptr) *most = greatest;
    return sum / static_cast<double>(count);
  }

 private:
  static std::complex<double> Turn(size_t n) {
    return std::polar(1.0, -2 * std::numbers::pi * static_cast<double>(n % kSide) / kSide);
  }
  std::vector<double> power_;
};

// No low frequencies, and no dominant direction, which would be visible as worms; at any share of
// lit pixels, and for every shift of the ranks by the slice's number.
TEST(BlueNoise, HasNoLowFrequencies) {
  const std::array<uint16_t, kNoiseRanks>& ranks = BlueNoise();
  for (const uint32_t slice : {0u, 1u, 7u, 100u}) {
    for (const uint32_t lit : {256u, 1024u, 2048u, 3072u}) {
      const Spectrum spectrum([&](size_t at) {
        return (ranks[at] + slice * kNoiseTurn) % kNoiseRanks >= kNoiseRanks - lit;
      });
      // The period that corresponds to the mean distance of the rarer pixels.
      const double principal = std::sqrt(std::min(lit, kNoiseRanks - lit));
      double most = 0;
      const double low = spectrum.Mean(1, std::min(principal, double{kSide} / 2) / 3, &most);
      std::printf("slice %u, %u of 4096 lit: low frequencies %.3f of white, at most %.3f\n", slice,
                  lit, low, most);
      EXPECT_LT(low, slice == 0 ? 0.1 : 0.25);
      EXPECT_LT(most, 1.0);
    }
  }
}

// With one bit, the mean of a ramp of 256 levels over 16³ pixels is within a level.
TEST(BlueNoise, RampOfOneBitIsWithinALevel) {
  const std::array<uint16_t, kNoiseRanks>& ranks = BlueNoise();
  double worst = 0, sum = 0;
  int64_t cells = 0;
  for (uint32_t c = 0; c < 256; ++c) {
    for (uint32_t cell = 0; cell < 64; ++cell) {
      const uint32_t u0 = cell % 4 * 16, v0 = cell / 4 % 4 * 16, s0 = cell / 16 * 16;
      uint32_t lit = 0;
      for (uint32_t n = 0; n < 4096; ++n) {
        const uint32_t u = u0 + n % 16, v = v0 + n / 16 % 16, slice = s0 + n / 256;
        lit += Quantize(c * 257, 2, NoiseThreshold(ranks[v * kSide + u], slice, 0, 1));
      }
      const double error = std::abs(lit / 4096.0 * 255 - c);
      worst = std::max(worst, error);
      sum += error;
      ++cells;
    }
  }
  std::printf("error over 16^3: mean %.3f, most %.3f of 255 levels\n",
              sum / static_cast<double>(cells), worst);
  EXPECT_LE(sum / static_cast<double>(cells), 1);
  EXPECT_LE(worst, 2);
}

}  // namespace
}  // namespace voxeld::gpu
