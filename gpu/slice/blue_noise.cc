#include "gpu/slice/blue_noise.h"

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace voxeld::gpu {
namespace {

constexpr size_t kSide = kNoiseSide, kCount = kNoiseRanks;
constexpr double kSigma =
    1.5;  // of the Gaussian with which pixels weigh on each other, as in the paper
constexpr size_t kReach = 9;  // farther off, a weight is less than half of the smallest weight
constexpr size_t kFirstOnes = kCount / 10;

// The pixels that are ones, and the sum of their weights on every pixel, in whole numbers: sums do
// not depend on their order.
class Pattern {
 public:
  Pattern() : kernel_(kCount), weight_(kCount), ones_(kCount), extremes_(kSide) {
    for (size_t y = 0; y < kSide; ++y) {
      for (size_t x = 0; x < kSide; ++x) {
        const double dx = static_cast<double>(x < kSide / 2 ? x : kSide - x);
        const double dy = static_cast<double>(y < kSide / 2 ? y : kSide - y);
        kernel_[y * kSide + x] =
            std::llround(std::exp(-(dx * dx + dy * dy) / (2 * kSigma * kSigma)) * (1 << 24));
      }
    }
    for (size_t y = 0; y < kSide; ++y) extremes_[y] = ExtremesOf(y);
  }

  bool one(size_t at) const { return ones_[at] != 0; }
  void Set(size_t at, bool one) {
    ones_[at] = one;
    const size_t x0 = at % kSide, y0 = at / kSide;
    for (size_t dy = kSide - kReach; dy <= kSide + kReach; ++dy) {
      const size_t y = (y0 + dy) % kSide;
      for (size_t dx = kSide - kReach; dx <= kSide + kReach; ++dx) {
        const int64_t weight = kernel_[dy % kSide * kSide + dx % kSide];
        weight_[y * kSide + (x0 + dx) % kSide] += one ? weight : -weight;
      }
      extremes_[y] = ExtremesOf(y);
    }
  }
  // Return the one on which the others weigh most, and the zero on which ones weigh least; the
  // first of several.
  size_t TightestCluster() const {
    size_t best = kNone;
    for (const Extremes& row : extremes_) {
      if (row.one != kNone && (best == kNone || weight_[row.one] > weight_[best])) best = row.one;
    }
    return best;
  }
  size_t LargestVoid() const {
    size_t best = kNone;
    for (const Extremes& row : extremes_) {
      if (row.zero != kNone && (best == kNone || weight_[row.zero] < weight_[best]))
        best = row.zero;
    }
    return best;
  }

 private:
  static constexpr size_t kNone = kCount;
  struct Extremes {
    size_t one = kNone, zero = kNone;
  };

  Extremes ExtremesOf(size_t y) const {
    Extremes row;
    for (size_t at = y * kSide; at < (y + 1) * kSide; ++at) {
      if (one(at)) {
        if (row.one == kNone || weight_[at] > weight_[row.one]) row.one = at;
      } else if (row.zero == kNone || weight_[at] < weight_[row.zero]) {
        row.zero = at;
      }
    }
    return row;
  }

  std::vector<int64_t> kernel_, weight_;
  std::vector<uint8_t> ones_;
  std::vector<Extremes> extremes_;  // of each row
};

// Places ones at random, then moves them from clusters into voids until that changes nothing.
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

std::array<uint16_t, kCount> MakeRanks() {
  Pattern pattern;
  Relax(pattern);
  std::array<uint16_t, kCount> ranks{};
  Pattern first = pattern;
  for (size_t rank = kFirstOnes; rank-- > 0;) {
    const size_t at = first.TightestCluster();
    first.Set(at, false);
    ranks[at] = static_cast<uint16_t>(rank);
  }
  // The zeros' weight is the weight of all pixels minus that of the ones, so the largest void is
  // the zeros' tightest cluster.
  for (size_t rank = kFirstOnes; rank < kCount; ++rank) {
    const size_t at = pattern.LargestVoid();
    pattern.Set(at, true);
    ranks[at] = static_cast<uint16_t>(rank);
  }
  return ranks;
}

}  // namespace

const std::array<uint16_t, kNoiseRanks>& BlueNoise() {
  static const std::array<uint16_t, kNoiseRanks> ranks = MakeRanks();
  return ranks;
}

}  // namespace voxeld::gpu
