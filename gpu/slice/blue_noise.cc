#include "gpu/slice/blue_noise.h"

#include <cmath>
#include <cstddef>
#include <random>

#include "gpu/slice/quantize.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kSide = kNoiseSide, kCount = kNoiseRanks;
constexpr double kSigma =
    1.5;  // of the Gaussian by which pixels weigh on each other, as the paper has it
constexpr size_t kFirstOnes = kCount / 10;

// Which pixels are ones, and how much these weigh on every pixel, in whole numbers: sums do not depend on their order.
class Pattern {
 public:
  Pattern() : kernel_(kCount), weight_(kCount), ones_(kCount) {
    for (size_t y = 0; y < kSide; ++y) {
      for (size_t x = 0; x < kSide; ++x) {
        const double dx = static_cast<double>(x < kSide / 2 ? x : kSide - x);
        const double dy = static_cast<double>(y < kSide / 2 ? y : kSide - y);
        kernel_[y * kSide + x] =
            std::llround(std::exp(-(dx * dx + dy * dy) / (2 * kSigma * kSigma)) * (1 << 24));
      }
    }
  }

  bool one(size_t at) const { return ones_[at] != 0; }
  void Set(size_t at, bool one) {
    ones_[at] = one;
    const size_t x0 = at % kSide, y0 = at / kSide;
    for (size_t y = 0; y < kSide; ++y) {
      const int64_t* const row = &kernel_[(y + kSide - y0) % kSide * kSide];
      for (size_t x = 0; x < kSide; ++x) {
        const int64_t weight = row[(x + kSide - x0) % kSide];
        weight_[y * kSide + x] += one ? weight : -weight;
      }
    }
  }
  // The one that others weigh on most; the zero that ones weigh on least. The first of several.
  size_t TightestCluster() const { return Extreme(true); }
  size_t LargestVoid() const { return Extreme(false); }

 private:
  size_t Extreme(bool one) const {
    size_t best = kCount;
    for (size_t i = 0; i < kCount; ++i) {
      if ((ones_[i] != 0) != one) continue;
      if (best == kCount || (one ? weight_[i] > weight_[best] : weight_[i] < weight_[best])) {
        best = i;
      }
    }
    return best;
  }

  std::vector<int64_t> kernel_, weight_;
  std::vector<uint8_t> ones_;
};

// Ones at random, moved from clusters into voids until that changes nothing.
void Relax(Pattern& pattern) {
  std::mt19937 random(1);
  for (size_t left = kFirstOnes; left > 0;) {
    const size_t at = random() % kCount;
    if (pattern.one(at)) continue;
    pattern.Set(at, true);
    --left;
  }
  while (true) {
    const size_t from = pattern.TightestCluster();
    pattern.Set(from, false);
    const size_t to = pattern.LargestVoid();
    pattern.Set(to, true);
    if (from == to) return;
  }
}

}  // namespace

std::vector<uint16_t> MakeBlueNoise() {
  Pattern pattern;
  Relax(pattern);
  std::vector<uint16_t> ranks(kCount);
  Pattern first = pattern;
  for (size_t rank = kFirstOnes; rank-- > 0;) {
    const size_t at = first.TightestCluster();
    first.Set(at, false);
    ranks[at] = static_cast<uint16_t>(rank);
  }
  // What the zeros weigh is what all weigh less what the ones weigh: the largest void is the zeros' tightest cluster.
  for (size_t rank = kFirstOnes; rank < kCount; ++rank) {
    const size_t at = pattern.LargestVoid();
    pattern.Set(at, true);
    ranks[at] = static_cast<uint16_t>(rank);
  }
  return ranks;
}

}  // namespace voxeld::gpu
