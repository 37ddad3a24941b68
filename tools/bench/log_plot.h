// Logarithmic plots and bar charts, as self-contained SVG.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace voxeld::bench {

struct Curve {
  std::string name;
  bool ours = false;                              // drawn thicker
  std::vector<std::pair<double, double>> points;  // positive, x ascending
  bool guide = false;                             // drawn dashed and grey: not a measurement
};

// Returns a plot with decades marked on both axes. If `x_marks` is not empty, x has these marks
// instead, positive and ascending, and its axis goes from the first to the last.
std::string LogLogSvg(const std::string& title, const std::string& x_label,
                      const std::string& y_label, const std::vector<Curve>& curves,
                      const std::vector<double>& x_marks = {});

struct Bar {
  std::string name;
  bool ours = false;
  double value = 0;  // positive
};

// Returns a bar chart of logarithmic lengths; each value is printed beside its bar.
std::string LogBarsSvg(const std::string& title, const std::string& label,
                       const std::vector<Bar>& bars);

}  // namespace voxeld::bench
