#include "tools/bench/log_plot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace voxeld::bench {
namespace {

constexpr double kWidth = 900, kHeight = 520, kLeft = 90, kRight = 250, kTop = 50, kBottom = 60;
constexpr double kRow = 30;
constexpr std::array kColours = {"#8a8a8a", "#b08d57", "#6b8fb2", "#8fae7a", "#a37aa3"};
constexpr std::array kOurColours = {"#1f6fb2", "#c8501e", "#2e8b57", "#7a2e8b"};

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

struct Axis {
  std::vector<double> marks;  // two or more, including both ends
  double begin = 0, length = 1;

  // Returns an axis of whole decades around all values.
  static Axis OfDecades(const std::vector<double>& values, double begin, double length) {
    const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
    const int first = static_cast<int>(std::floor(std::log10(*least)));
    const int last = std::max(first + 1, static_cast<int>(std::ceil(std::log10(*greatest))));
    Axis axis{{}, begin, length};
    for (int p = first; p <= last; ++p) axis.marks.push_back(std::pow(10, p));
    return axis;
  }
  double At(double value) const {
    const double first = std::log10(marks.front()), last = std::log10(marks.back());
    return begin + (std::log10(value) - first) / (last - first) * length;
  }
};

std::string MarkName(double mark) { return absl::StrFormat("%g", mark); }

}  // namespace

std::string LogLogSvg(const std::string& title, const std::string& x_label,
                      const std::string& y_label, const std::vector<Curve>& curves,
                      const std::vector<double>& x_marks) {
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
  const Axis x =
      x_marks.size() < 2 ? Axis::OfDecades(xs, kLeft, width) : Axis{x_marks, kLeft, width};
  const Axis y = Axis::OfDecades(ys, kTop + height, -height);
  for (const double mark : x.marks) {
    const double at = x.At(mark);
    out +=
        Line(at, kTop, at, kTop + height) + Text(at, kTop + height + 18, "middle", MarkName(mark));
  }
  for (const double mark : y.marks) {
    const double at = y.At(mark);
    out += Line(kLeft, at, kLeft + width, at) + Text(kLeft - 6, at + 4, "end", MarkName(mark));
  }
  out += Text(kLeft + width / 2, kHeight - 14, "middle", x_label) +
         Text(kLeft, kTop - 8, "start", y_label);
  double legend = kTop + 8;
  size_t ours = 0, others = 0;
  for (const Curve& curve : curves) {
    const char* colour = curve.guide  ? "#888"
                         : curve.ours ? kOurColours[ours++ % kOurColours.size()]
                                      : kColours[others++ % kColours.size()];
    absl::StrAppendFormat(
        &out, "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"%s\"%s points=\"", colour,
        curve.ours ? "2.4" : "1.2", curve.guide ? " stroke-dasharray=\"6 5\"" : "");
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
  const Axis x = Axis::OfDecades(values, kNames, kWidth - kNames - kNumbers);
  const double bottom = kTop + static_cast<double>(bars.size()) * kRow;
  for (const double mark : x.marks) {
    const double at = x.At(mark);
    out += Line(at, kTop, at, bottom) + Text(at, bottom + 18, "middle", MarkName(mark));
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

}  // namespace voxeld::bench
