#include "tools/bench/voxel_bench/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace voxeld::bench {
namespace {

constexpr double kWidth = 900, kPanelHeight = 220;
constexpr double kLeft = 80, kRight = 20, kTop = 40, kGap = 45;
constexpr int kTicks = 5;
constexpr std::array kColours = {"#1f6fb2", "#c8501e", "#2e8b57", "#7a4ea3"};

std::string Escape(const std::string& text) {
  return absl::StrReplaceAll(text,
                             {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

std::string Text(double x, double y, const char* anchor, const std::string& text) {
  return absl::StrFormat("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n", x, y, anchor,
                         Escape(text));
}

// Maps a value to its place on an axis of `length` pixels.
struct Axis {
  double least = 0, greatest = 1, begin = 0, length = 1;
  double At(double value) const { return begin + (value - least) / (greatest - least) * length; }
};

std::string PanelOf(const Panel& panel, const Axis& x, double top) {
  double greatest = 0;
  for (const Series& series : panel.series) {
    for (const auto& [at, value] : series.points) greatest = std::max(greatest, value);
  }
  const Axis y{0, RoundAbove(greatest), top + kPanelHeight, -kPanelHeight};
  std::string out;
  for (int i = 0; i <= kTicks; ++i) {
    const double value = y.greatest * i / kTicks, at = y.At(value);
    absl::StrAppendFormat(
        &out, "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd\"/>\n", kLeft,
        at, kLeft + x.length, at);
    out += Text(kLeft - 6, at + 4, "end", absl::StrFormat("%g", value));
  }
  out += Text(kLeft, top - 8, "start", panel.label);
  double legend = kLeft + x.length;
  for (size_t i = panel.series.size(); i-- > 0;) {
    const Series& series = panel.series[i];
    const char* colour = kColours[i % kColours.size()];
    absl::StrAppendFormat(&out,
                          "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\" fill=\"%s\">%s</text>\n",
                          legend, top - 8, colour, Escape(series.name));
    legend -= 8.0 * static_cast<double>(series.name.size()) + 16;
    absl::StrAppendFormat(
        &out, "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"1.2\" points=\"", colour);
    for (const auto& [at, value] : series.points) {
      absl::StrAppendFormat(&out, "%.1f,%.1f ", x.At(at), y.At(value));
    }
    out += "\"/>\n";
  }
  return out;
}

}  // namespace

double RoundAbove(double value) {
  if (!(value > 0)) return 1;
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (step * power >= value) return step * power;
  }
  return 10 * power;
}

std::string SvgOf(const std::string& title, const std::string& x_label,
                  const std::vector<Panel>& panels) {
  double least = 0, greatest = 0;
  for (const Panel& panel : panels) {
    for (const Series& series : panel.series) {
      if (series.points.empty()) continue;
      least = std::min(least, series.points.front().first);
      greatest = std::max(greatest, series.points.back().first);
    }
  }
  const Axis x{least, greatest > least ? greatest : least + 1, kLeft, kWidth - kLeft - kRight};
  const double bottom = kTop + static_cast<double>(panels.size()) * (kPanelHeight + kGap);
  std::string out = absl::StrFormat(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n"
      "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
      kWidth, bottom + kGap);
  out += Text(kWidth / 2, 18, "middle", title);
  double top = kTop + 10;
  for (const Panel& panel : panels) {
    out += PanelOf(panel, x, top);
    top += kPanelHeight + kGap;
  }
  for (int i = 0; i <= kTicks; ++i) {
    const double value = x.least + (x.greatest - x.least) * i / kTicks;
    out += Text(x.At(value), top - kGap + 18, "middle", absl::StrFormat("%.4g", value));
  }
  out += Text(kLeft + x.length / 2, top - kGap + 36, "middle", x_label);
  return absl::StrCat(out, "</svg>\n");
}

}  // namespace voxeld::bench
