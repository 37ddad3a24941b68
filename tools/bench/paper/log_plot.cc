#include "tools/bench/paper/log_plot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace voxeld::bench::paper {
namespace {

constexpr double kWidth = 900, kHeight = 520, kLeft = 90, kRight = 250, kTop = 50, kBottom = 60;
constexpr double kRow = 30;
constexpr std::array kColours = {"#8a8a8a", "#b08d57", "#6b8fb2", "#8fae7a", "#a37aa3",
                                 "#1f6fb2", "#c8501e", "#2e8b57", "#7a2e8b"};

std::string Escape(const std::string& text) {
  return absl::StrReplaceAll(text,
                             {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

std::string Text(double x, double y, const char* anchor, const std::string& text,
                 const char* colour = "#222") {
  return absl::StrFormat("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" fill=\"%s\">%s</text>\n",
                         x, y, anchor, colour, Escape(text));
}

std::string Line(double x1, double y1, double x2, double y2) {
  return absl::StrFormat(
      "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd\"/>\n", x1, y1, x2, y2);
}

std::string Begin(double height, const std::string& title) {
  return absl::StrFormat(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" viewBox=\"0 "
             "0 %.0f %.0f\" "
             "font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%%\" height=\"100%%\" "
             "fill=\"#fff\"/>\n",
             kWidth, height, kWidth, height) +
         Text(kLeft, 26, "start", title);
}

// Whole decades around all values.
struct Decades {
  int first = 0, last = 1;
  double begin = 0, length = 1;

  static Decades Of(const std::vector<double>& values, double begin, double length) {
    const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
    Decades d{static_cast<int>(std::floor(std::log10(*least))),
              static_cast<int>(std::ceil(std::log10(*greatest))), begin, length};
    d.last = std::max(d.last, d.first + 1);
    return d;
  }
  double At(double value) const {
    return begin + (std::log10(value) - first) / (last - first) * length;
  }
};

std::string PowerName(int power) { return absl::StrFormat("%g", std::pow(10, power)); }

}  // namespace

std::string LogLogSvg(const std::string& title, const std::string& x_label,
                      const std::string& y_label, const std::vector<Curve>& curves) {
  std::vector<double> xs, ys;
  for (const Curve& curve : curves) {
    for (const auto& [x, y] : curve.points) {
      xs.push_back(x);
      ys.push_back(y);
    }
  }
  std::string out = Begin(kHeight, title);
  if (xs.empty()) return out + "</svg>\n";
  const double width = kWidth - kLeft - kRight, height = kHeight - kTop - kBottom;
  const Decades x = Decades::Of(xs, kLeft, width), y = Decades::Of(ys, kTop + height, -height);
  for (int p = x.first; p <= x.last; ++p) {
    const double at = x.At(std::pow(10, p));
    out += Line(at, kTop, at, kTop + height) + Text(at, kTop + height + 18, "middle", PowerName(p));
  }
  for (int p = y.first; p <= y.last; ++p) {
    const double at = y.At(std::pow(10, p));
    out += Line(kLeft, at, kLeft + width, at) + Text(kLeft - 6, at + 4, "end", PowerName(p));
  }
  out += Text(kLeft + width / 2, kHeight - 14, "middle", x_label) +
         Text(kLeft, kTop - 8, "start", y_label);
  double legend = kTop + 8;
  for (size_t i = 0; i < curves.size(); ++i) {
    const Curve& curve = curves[i];
    const char* colour = kColours[i % kColours.size()];
    absl::StrAppendFormat(&out,
                          "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"%s\" points=\"",
                          colour, curve.ours ? "2.4" : "1.2");
    for (const auto& [px, py] : curve.points)
      absl::StrAppendFormat(&out, "%.1f,%.1f ", x.At(px), y.At(py));
    out += "\"/>\n" + Text(kLeft + width + 14, legend, "start", curve.name, colour);
    legend += 20;
  }
  return out + "</svg>\n";
}

std::string LogBarsSvg(const std::string& title, const std::string& label,
                       const std::vector<Bar>& bars) {
  const double height = kTop + static_cast<double>(bars.size()) * kRow + kBottom;
  std::string out = Begin(height, title);
  if (bars.empty()) return out + "</svg>\n";
  std::vector<double> values;
  values.reserve(bars.size());
  for (const Bar& bar : bars) values.push_back(bar.value);
  constexpr double kNames = 230, kNumbers = 110;
  const Decades x = Decades::Of(values, kNames, kWidth - kNames - kNumbers);
  const double bottom = kTop + static_cast<double>(bars.size()) * kRow;
  for (int p = x.first; p <= x.last; ++p) {
    const double at = x.At(std::pow(10, p));
    out += Line(at, kTop, at, bottom) + Text(at, bottom + 18, "middle", PowerName(p));
  }
  out += Text(kNames + (kWidth - kNames - kNumbers) / 2, bottom + 44, "middle", label);
  for (size_t i = 0; i < bars.size(); ++i) {
    const double top = kTop + static_cast<double>(i) * kRow;
    const char* colour = bars[i].ours ? "#1f6fb2" : "#8a8a8a";
    absl::StrAppendFormat(
        &out, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\"/>\n", kNames,
        top + 5, std::max(1.0, x.At(bars[i].value) - kNames), kRow - 10, colour);
    out += Text(kNames - 8, top + 20, "end", bars[i].name) +
           Text(std::max(kNames, x.At(bars[i].value)) + 8, top + 20, "start",
                absl::StrFormat("%.*f", bars[i].value < 100 ? 1 : 0, bars[i].value));
  }
  return out + "</svg>\n";
}

}  // namespace voxeld::bench::paper
