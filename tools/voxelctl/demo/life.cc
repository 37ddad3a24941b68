#include "tools/voxelctl/demo/life.h"

#include <algorithm>
#include <random>

namespace voxeld::voxelctl {
namespace {

constexpr int kStays = 4, kBorn = 4;
constexpr size_t kLongestPeriod = 12;
constexpr size_t kMostSteps = 160;
constexpr uint64_t kOneIn = 5;

}  // namespace

Life::Life(int side)
    : side_(std::max(side, 4)),
      cells_(static_cast<size_t>(side_) * static_cast<size_t>(side_) * static_cast<size_t>(side_)),
      next_(cells_.size()) {}

size_t Life::Index(int x, int y, int z) const {
  const auto around = [&](int v) { return static_cast<size_t>((v % side_ + side_) % side_); };
  const auto side = static_cast<size_t>(side_);
  return around(x) + side * (around(y) + side * around(z));
}

void Life::Sow(uint64_t seed) {
  std::fill(cells_.begin(), cells_.end(), kEmpty);
  std::mt19937_64 chance(seed);
  const int half = std::max(side_ / 4, 2);
  const int low = (side_ - 1) / 2, high = side_ / 2;  // equal if the side is odd
  for (int z = 0; z < half; ++z) {
    for (int y = 0; y < half; ++y) {
      for (int x = 0; x < half; ++x) {
        if (chance() % kOneIn != 0) continue;
        for (int corner = 0; corner < 8; ++corner) {
          Set((corner & 1) != 0 ? high + x : low - x, (corner & 2) != 0 ? high + y : low - y,
              (corner & 4) != 0 ? high + z : low - z, kAlive);
        }
      }
    }
  }
}

void Life::Step() {
  for (int z = 0; z < side_; ++z) {
    for (int y = 0; y < side_; ++y) {
      for (int x = 0; x < side_; ++x) {
        const uint8_t state = At(x, y, z);
        uint8_t& next = next_[Index(x, y, z)];
        if (state != kEmpty && state != kAlive) {
          next = state - 1;
          continue;
        }
        int around = state == kAlive ? -1 : 0;
        for (int dz = -1; dz <= 1; ++dz) {
          for (int dy = -1; dy <= 1; ++dy) {
            for (int dx = -1; dx <= 1; ++dx) around += At(x + dx, y + dy, z + dz) == kAlive ? 1 : 0;
          }
        }
        if (state == kAlive) {
          next = around == kStays ? kAlive : kAlive - 1;
        } else {
          next = around == kBorn ? kAlive : kEmpty;
        }
      }
    }
  }
  cells_.swap(next_);
}

uint32_t Life::living() const {
  return static_cast<uint32_t>(std::count(cells_.begin(), cells_.end(), kAlive));
}

bool LifeWatch::IsOver(const Life& life) {
  uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  for (const uint8_t cell : life.cells()) hash = (hash ^ cell) * 0x100000001b3;
  const size_t from = hashes_.size() - std::min(hashes_.size(), kLongestPeriod);
  const bool again = std::find(hashes_.begin() + static_cast<ptrdiff_t>(from), hashes_.end(),
                               hash) != hashes_.end();
  hashes_.push_back(hash);
  return again || life.living() == 0 || hashes_.size() > kMostSteps;
}

}  // namespace voxeld::voxelctl
