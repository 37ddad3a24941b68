// Plots with logarithms on their axes, and bars, as SVG that needs nothing else.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace voxeld::bench::paper {

struct Curve {
  std::string name;
  bool ours = false;                              // drawn thicker
  std::vector<std::pair<double, double>> points;  // above 0, x ascending
};

// Decades are marked on both axes.
std::string LogLogSvg(const std::string& title, const std::string& x_label,
                      const std::string& y_label, const std::vector<Curve>& curves);

struct Bar {
  std::string name;
  bool ours = false;
  double value = 0;  // above 0
};

// Lengths go with the logarithm; each value stands beside its bar.
std::string LogBarsSvg(const std::string& title, const std::string& label,
                       const std::vector<Bar>& bars);

}  // namespace voxeld::bench::paper
