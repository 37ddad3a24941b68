#include "tools/bench/paper/workload.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace voxeld::bench::paper {
namespace {

using gpu::generate::Output;
using gpu::generate::Segment;
using gpu::generate::StepsOf;

// Makes segments. Directions are spread evenly; a length of half a voxel beyond the last step is
// safe against rounding.
class Maker {
 public:
  explicit Maker(uint64_t seed) : random_(seed) {}

  Segment<double> OfVoxels(uint64_t voxels) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> place(-1000, 1000);
    std::array<double, 3> d = {};
    double length = 0;
    while (length < 1e-3) {
      length = 0;
      for (double& v : d) {
        v = normal(random_);
        length += v * v;
      }
    }
    length = std::sqrt(length);
    Segment<double> segment;
    for (size_t a = 0; a < 3; ++a) {
      segment.start[a] = place(random_);
      segment.end[a] = segment.start[a] + d[a] / length * (static_cast<double>(voxels) - 0.5);
    }
    return segment;
  }
  double Within(double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random_);
  }

 private:
  std::mt19937_64 random_;
};

Workload OfLengths(const std::string& table, const std::vector<uint64_t>& lengths, uint64_t seed) {
  Workload out;
  out.table = table;
  Maker maker(seed);
  for (const uint64_t voxels : lengths) {
    out.segments.push_back(maker.OfVoxels(voxels));
    out.voxels += voxels;
  }
  return out;
}

// Returns lengths of 0.05 to 1.95 times the mean that add up to `total`.
std::vector<uint64_t> Lengths(uint64_t count, uint64_t total, uint64_t seed) {
  Maker maker(seed);
  std::vector<uint64_t> lengths;
  uint64_t sum = 0;
  for (uint64_t i = 0; i < count; ++i) {
    const double length =
        static_cast<double>(total) / static_cast<double>(count) * maker.Within(0.05, 1.95);
    // Ends less than a voxel apart may lie in two voxels.
    lengths.push_back(std::max<uint64_t>(2, static_cast<uint64_t>(length)));
    sum += lengths.back();
  }
  // The difference to `total` is spread over all lengths.
  for (uint64_t i = 0; sum != total; i = (i + 1) % count) {
    const auto difference = static_cast<int64_t>(total) - static_cast<int64_t>(sum);
    const int64_t part = difference / static_cast<int64_t>(count) + (difference > 0 ? 1 : -1);
    const auto changed = static_cast<int64_t>(lengths[i]) + part;
    if (changed < 2 || std::abs(part) > std::abs(difference)) continue;
    lengths[i] = static_cast<uint64_t>(changed);
    sum += static_cast<uint64_t>(part);
  }
  return lengths;
}

}  // namespace

Workload OneLength(const std::string& table, uint64_t count, uint64_t voxels, uint64_t seed) {
  return OfLengths(table, std::vector<uint64_t>(count, voxels), seed);
}

Workload Different(uint64_t total, uint64_t seed) {
  return OfLengths("4", Lengths(kSegments, total, seed), seed + 1);
}

Workload Skewed(uint64_t total, uint64_t seed) {
  std::vector<uint64_t> lengths = Lengths(kSegments - 1, total / 10, seed);
  lengths.insert(lengths.begin() + static_cast<ptrdiff_t>(kSegments / 2), total - total / 10);
  return OfLengths("4 skewed", lengths, seed + 1);
}

Workload Packed(uint64_t total, uint64_t seed) {
  Workload out;
  out.table = "4 packed";
  out.format.output = Output::kPacked;
  Maker maker(seed);
  while (out.voxels < total) {
    Segment<double> segment;
    for (auto* p : {&segment.start, &segment.end}) {
      *p = {maker.Within(0, 2047.9), maker.Within(0, 2047.9), maker.Within(0, 1023.9)};
    }
    out.voxels += static_cast<uint64_t>(StepsOf(ToFixed(segment), out.format.sampling)) + 1;
    out.segments.push_back(segment);
  }
  return out;
}

}  // namespace voxeld::bench::paper
