// Plots over a common time axis, as SVG.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace voxeld::bench {

struct Series {
  std::string name;
  std::vector<std::pair<double, double>> points;  // x ascending; finite
};

struct Panel {
  std::string label;  // of the y axis, with its unit
  std::vector<Series> series;
};

// Draws the panels one below the other, each with a y axis from 0 to a round number above its
// greatest value. The SVG is self-contained and text is escaped.
std::string SvgOf(const std::string& title, const std::string& x_label,
                  const std::vector<Panel>& panels);

// Returns the least of 1, 2, 5, 10, 20, … and 0.5, 0.2, 0.1, … that is not below `value`; 1 if
// `value` is not positive.
double RoundAbove(double value);

}  // namespace voxeld::bench
