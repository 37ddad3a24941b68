// Statistics of several measurements of one quantity.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace voxeld::bench {

// The spread of measurements in the order in which they were made. The median of an even number is
// the mean of the middle two. Without measurements, everything is 0.
struct Spread {
  double median = 0, least = 0, greatest = 0;
  std::vector<double> values;
};
Spread SpreadOf(std::vector<double> values);

// Returns the spread of values[i] / baseline[i] for values that were measured alternately, up to
// the shorter of the two. A baseline of 0 is left out.
Spread RatiosOf(std::span<const double> values, std::span<const double> baseline);

// Returns the quantile by nearest rank: the least value such that at least `share` of all values
// are not above it; 0 without values. `share` is in [0, 1].
double QuantileOf(std::vector<double> values, double share);

// Returns Jain's index of fairness, (Σx)² / (n·Σx²): 1 if all are equal, 1/n if one has everything;
// 0 without values.
double JainIndexOf(std::span<const double> values);

double MeanOf(std::span<const double> values);  // 0 without values

}  // namespace voxeld::bench
