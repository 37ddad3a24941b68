// What several measurements of one thing say.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace voxeld::bench {

// Of measurements in the order in which they were made. The median of an even number is the mean of
// the middle two. Of none: all 0.
struct Spread {
  double median = 0, least = 0, greatest = 0;
  std::vector<double> values;
};
Spread SpreadOf(std::vector<double> values);

// Of pairs measured in turns: values[i] / baseline[i], as far as both go. A baseline of 0 is left
// out.
Spread RatiosOf(std::span<const double> values, std::span<const double> baseline);

// Nearest rank: the least value that at least `share` of all are not above. 0 of none. `share` in
// [0, 1].
double QuantileOf(std::vector<double> values, double share);

// Jain's index of fairness, (Σx)² / (n·Σx²): 1 if all have the same, 1/n if one has all. 0 of none.
double JainIndexOf(std::span<const double> values);

double MeanOf(std::span<const double> values);  // 0 of none

}  // namespace voxeld::bench
