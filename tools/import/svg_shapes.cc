#include "tools/import/svg_shapes.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kCircle = 0.5522847498307936;  // of a radius: a quarter's handle, 4/3·(√2 − 1)

struct FreeText {
  void operator()(xmlChar* text) const { xmlFree(text); }
};

const xmlChar* Xml(const char* text) { return reinterpret_cast<const xmlChar*>(text); }

std::string Taken(xmlChar* given) {
  const std::unique_ptr<xmlChar, FreeText> text(given);
  return text == nullptr ? std::string() : reinterpret_cast<const char*>(text.get());
}

Polyline Ellipse(double x, double y, double rx, double ry) {
  Polyline line{.points = {{x + rx, y}}, .closed = true};
  const double u = rx * kCircle, v = ry * kCircle;
  AddCubic({x + rx, y}, {x + rx, y + v}, {x + u, y + ry}, {x, y + ry}, &line.points);
  AddCubic({x, y + ry}, {x - u, y + ry}, {x - rx, y + v}, {x - rx, y}, &line.points);
  AddCubic({x - rx, y}, {x - rx, y - v}, {x - u, y - ry}, {x, y - ry}, &line.points);
  AddCubic({x, y - ry}, {x + u, y - ry}, {x + rx, y - v}, {x + rx, y}, &line.points);
  return line;
}

Polyline Rectangle(double x, double y, double w, double h, double rx, double ry) {
  if (!(rx > 0 && ry > 0))
    return {.points = {{x, y}, {x + w, y}, {x + w, y + h}, {x, y + h}}, .closed = true};
  rx = std::min(rx, w / 2), ry = std::min(ry, h / 2);
  const double u = rx * (1 - kCircle), v = ry * (1 - kCircle), r = x + w, b = y + h;
  Polyline line{.points = {{x + rx, y}, {r - rx, y}}, .closed = true};
  AddCubic({r - rx, y}, {r - u, y}, {r, y + v}, {r, y + ry}, &line.points);
  line.points.push_back({r, b - ry});
  AddCubic({r, b - ry}, {r, b - v}, {r - u, b}, {r - rx, b}, &line.points);
  line.points.push_back({x + rx, b});
  AddCubic({x + rx, b}, {x + u, b}, {x, b - v}, {x, b - ry}, &line.points);
  line.points.push_back({x, y + ry});
  AddCubic({x, y + ry}, {x, y + v}, {x + u, y}, {x + rx, y}, &line.points);
  return line;
}

}  // namespace

absl::string_view SvgName(const xmlNode* node) { return reinterpret_cast<const char*>(node->name); }

std::string SvgAttribute(const xmlNode* node, const char* name) {
  return Taken(xmlGetNoNsProp(node, Xml(name)));
}

std::string SvgReference(const xmlNode* node) {
  std::string href = SvgAttribute(node, "href");
  if (!href.empty()) return href;
  return Taken(xmlGetNsProp(node, Xml("href"), Xml("http://www.w3.org/1999/xlink")));
}

double SvgLength(const xmlNode* node, const char* name, double otherwise) {
  static constexpr std::pair<absl::string_view, double> kUnits[] = {
      {"px", 1},         {"pt", 4.0 / 3}, {"pc", 16}, {"mm", 96 / 25.4},
      {"cm", 96 / 2.54}, {"in", 96},      {"em", 16}};
  const std::string text = SvgAttribute(node, name);
  absl::string_view rest = text;
  double value = 0;
  if (!TakeNumber(&rest, &value)) return otherwise;
  rest = absl::StripAsciiWhitespace(rest);
  for (const auto& [unit, factor] : kUnits) {
    if (rest == unit) return value * factor;
  }
  return rest == "%" ? otherwise : value;
}

absl::StatusOr<std::vector<Polyline>> SvgShape(const xmlNode* node, size_t most) {
  const absl::string_view name = SvgName(node);
  const auto length = [node](const char* attribute, double otherwise = 0) {
    return SvgLength(node, attribute, otherwise);
  };
  if (name == "path") {
    absl::StatusOr<std::vector<Polyline>> lines = ParseSvgPath(SvgAttribute(node, "d"), most);
    if (lines.ok()) return lines;
    return absl::Status(lines.status().code(),
                        absl::StrCat("has path data that are wrong; ", lines.status().message()));
  }
  if (name == "rect") {
    const double w = length("width"), h = length("height");
    if (!(w > 0 && h > 0)) return std::vector<Polyline>();
    const double rx = length("rx", length("ry")), ry = length("ry", rx);
    return std::vector<Polyline>{Rectangle(length("x"), length("y"), w, h, rx, ry)};
  }
  if (name == "circle" || name == "ellipse") {
    const double rx = length(name == "circle" ? "r" : "rx"),
                 ry = name == "circle" ? rx : length("ry");
    if (!(rx > 0 && ry > 0)) return std::vector<Polyline>();
    return std::vector<Polyline>{Ellipse(length("cx"), length("cy"), rx, ry)};
  }
  if (name == "line") {
    return std::vector<Polyline>{
        {.points = {{length("x1"), length("y1")}, {length("x2"), length("y2")}}}};
  }
  if (name == "polyline" || name == "polygon") {
    Polyline line{.points = {}, .closed = name == "polygon"};
    const std::string text = SvgAttribute(node, "points");
    absl::string_view rest = text;
    Point2 p;
    while (TakeNumber(&rest, &p.x) && TakeNumber(&rest, &p.y)) line.points.push_back(p);
    if (!absl::StripAsciiWhitespace(rest).empty()) {
      return absl::InvalidArgumentError(absl::StrCat("has \"",
                                                     EscapeForTerminal(rest.substr(0, 20)),
                                                     "\" among its points; numbers are expected"));
    }
    return std::vector<Polyline>{std::move(line)};
  }
  return std::vector<Polyline>();
}

}  // namespace voxeld::voxelctl
