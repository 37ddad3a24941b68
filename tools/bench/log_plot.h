// Plots with logarithms on their axes, and bars, as SVG that needs nothing else.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace voxeld::bench {

struct Curve {
  std::string name;
  bool ours = false;                              // drawn thicker
  std::vector<std::pair<double, double>> points;  // above 0, x ascending
  bool guide = false;                             // drawn dashed and grey: no measurement
};

// Decades are marked on both axes; on x `x_marks` instead, above 0 and ascending, if there are any:
// the axis goes from the first to the last then.
std::string LogLogSvg(const std::string& title, const std::string& x_label,
                      const std::string& y_label, const std::vector<Curve>& curves,
                      const std::vector<double>& x_marks = {});

struct Bar {
  std::string name;
  bool ours = false;
  double value = 0;  // above 0
};

// Lengths go with the logarithm; each value stands beside its bar.
std::string LogBarsSvg(const std::string& title, const std::string& label,
                       const std::vector<Bar>& bars);

}  // namespace voxeld::bench
