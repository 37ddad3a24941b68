#include "tools/bench/voxel_bench/statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace voxeld::bench {

Spread SpreadOf(std::vector<double> values) {
  Spread out;
  if (values.empty()) return out;
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  const size_t last = sorted.size() - 1;
  out.median = (sorted[last / 2] + sorted[last - last / 2]) / 2;
  out.least = sorted.front();
  out.greatest = sorted.back();
  out.values = std::move(values);
  return out;
}

Spread RatiosOf(std::span<const double> values, std::span<const double> baseline) {
  std::vector<double> ratios;
  for (size_t i = 0; i < std::min(values.size(), baseline.size()); ++i) {
    if (baseline[i] != 0) ratios.push_back(values[i] / baseline[i]);
  }
  return SpreadOf(std::move(ratios));
}

double QuantileOf(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const double rank = std::ceil(std::clamp(share, 0.0, 1.0) * static_cast<double>(values.size()));
  const auto at = values.begin() + static_cast<ptrdiff_t>(std::max(rank, 1.0)) - 1;
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double JainIndexOf(std::span<const double> values) {
  double sum = 0, squares = 0;
  for (const double value : values) {
    sum += value;
    squares += value * value;
  }
  if (squares == 0) return 0;
  return sum * sum / (static_cast<double>(values.size()) * squares);
}

double MeanOf(std::span<const double> values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace voxeld::bench
