#include "tools/voxelctl/import/svg_lines.h"

#include <libxml/parser.h>
#include <libxml/tree.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/svg_path.h"
#include "tools/voxelctl/import/svg_style.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostBytes = 64 << 20;
constexpr int kMostDepth = 100;
constexpr uint64_t kMostVisits = 1'000'000;
constexpr double kCircle = 0.5522847498307936;  // of a radius: a quarter's handle, 4/3·(√2 − 1)

// x' = a·x + c·y + e, y' = b·x + d·y + f
struct Matrix2 {
  double a = 1, b = 0, c = 0, d = 1, e = 0, f = 0;

  Point2 operator()(const Point2& p) const {
    return {a * p.x + c * p.y + e, b * p.x + d * p.y + f};
  }
  // What is mapped by `inner` first.
  Matrix2 operator*(const Matrix2& inner) const {
    return {a * inner.a + c * inner.b,     b * inner.a + d * inner.b,
            a * inner.c + c * inner.d,     b * inner.c + d * inner.d,
            a * inner.e + c * inner.f + e, b * inner.e + d * inner.f + f};
  }
};

struct FreeText {
  void operator()(xmlChar* text) const { xmlFree(text); }
};

absl::string_view Name(const xmlNode* node) { return reinterpret_cast<const char*>(node->name); }

class Drawer {
 public:
  explicit Drawer(const SourceFile& file) : file_(file) { part_.kind = Kind::kSegments; }

  absl::StatusOr<Model> Draw(xmlNode* root) {
    Collect(root, 0);
    if (absl::Status status = Visit(root, Matrix2(), SvgStyle(), 0); !status.ok()) return status;
    if (part_.indices.empty()) {
      return FileError(file_, "has no line that is to be seen",
                       "at least one path or shape is expected");
    }
    Model model;
    model.path = file_.path;
    model.format = "SVG";
    model.up = Up::kY;
    model.lit_already = true;
    std::vector<std::string> counts;
    counts.reserve(left_out_.size());
    for (const auto& [what, count] : left_out_) counts.push_back(absl::StrCat(count, " ", what));
    if (!counts.empty()) {
      model.note = absl::StrCat(file_.path, ": left out are elements of the kinds ",
                                absl::StrJoin(counts, ", "));
    }
    model.parts.push_back(std::move(part_));
    return model;
  }

 private:
  static std::string Attribute(const xmlNode* node, const char* name) {
    const std::unique_ptr<xmlChar, FreeText> text(
        xmlGetNoNsProp(node, reinterpret_cast<const xmlChar*>(name)));
    return text == nullptr ? std::string() : reinterpret_cast<const char*>(text.get());
  }
  static std::string Reference(const xmlNode* node) {
    std::string href = Attribute(node, "href");
    if (!href.empty()) return href;
    const std::unique_ptr<xmlChar, FreeText> text(
        xmlGetNsProp(node, reinterpret_cast<const xmlChar*>("href"),
                     reinterpret_cast<const xmlChar*>("http://www.w3.org/1999/xlink")));
    return text == nullptr ? std::string() : reinterpret_cast<const char*>(text.get());
  }

  absl::Status Wrong(const xmlNode* node, absl::string_view found,
                     absl::string_view expected) const {
    return FileError(
        file_, absl::StrCat("line ", xmlGetLineNo(node), ": <", Name(node), "> ", found), expected);
  }

  // Ids, and style sheets, wherever they stand.
  void Collect(xmlNode* node, int depth) {
    for (; node != nullptr && depth < kMostDepth * 3; node = node->next) {
      if (node->type != XML_ELEMENT_NODE) continue;
      const std::string id = Attribute(node, "id");
      if (!id.empty()) ids_.emplace(id, node);
      if (Name(node) == "style") {
        const std::unique_ptr<xmlChar, FreeText> text(xmlNodeGetContent(node));
        if (text != nullptr) AddCssRules(reinterpret_cast<const char*>(text.get()), &rules_);
      }
      Collect(node->children, depth + 1);
    }
  }

  SvgStyle StyleOf(const xmlNode* node, SvgStyle style) const {
    for (const char* property : {"fill", "stroke", "color", "display", "visibility"})
      style.Set(property, Attribute(node, property));
    const auto apply = [&](const std::string& selector) {
      const auto rule = rules_.find(selector);
      if (rule != rules_.end()) style.SetAll(rule->second);
    };
    if (!rules_.empty()) {
      apply(std::string(Name(node)));
      for (const absl::string_view word :
           absl::StrSplit(Attribute(node, "class"), ' ', absl::SkipWhitespace()))
        apply(absl::StrCat(".", word));
      apply(absl::StrCat("#", Attribute(node, "id")));
    }
    style.SetAll(Attribute(node, "style"));
    return style;
  }

  absl::Status Visit(xmlNode* node, const Matrix2& outer, const SvgStyle& outer_style, int depth) {
    if (depth > kMostDepth || ++visits_ > kMostVisits) {
      return Wrong(node, "stands in elements that are within, or use, each other without end",
                   absl::StrCat("at most ", kMostDepth, " deep are read"));
    }
    const SvgStyle style = StyleOf(node, outer_style);
    if (style.hidden) return absl::OkStatus();
    const absl::string_view name = Name(node);
    absl::StatusOr<Matrix2> own = TransformOf(node);
    if (!own.ok()) return own.status();
    Matrix2 matrix = outer * *own;
    if (name == "g" || name == "a" || name == "switch" || name == "svg" || name == "symbol") {
      if (name == "svg" && depth > 0) {
        matrix = matrix * Matrix2{.e = Length(node, "x", 0), .f = Length(node, "y", 0)};
      }
      for (xmlNode* child = node->children; child != nullptr; child = child->next) {
        if (child->type != XML_ELEMENT_NODE || Name(child) == "symbol") continue;
        if (absl::Status status = Visit(child, matrix, style, depth + 1); !status.ok())
          return status;
      }
      return absl::OkStatus();
    }
    if (name == "use") {
      const std::string href = Reference(node);
      const auto used = href.size() > 1 && href[0] == '#' ? ids_.find(href.substr(1)) : ids_.end();
      if (used == ids_.end()) {
        return Wrong(node, absl::StrCat("uses \"", EscapeForTerminal(href.substr(0, 60)), "\""),
                     "an id of this file is expected, as #ID");
      }
      return Visit(used->second,
                   matrix * Matrix2{.e = Length(node, "x", 0), .f = Length(node, "y", 0)}, style,
                   depth + 1);
    }
    if (name == "text" || name == "image" || name == "foreignObject" || name == "clipPath" ||
        name == "mask") {
      ++left_out_[std::string(name)];
      return absl::OkStatus();
    }
    absl::StatusOr<std::vector<Polyline>> lines = LinesOf(node, name);
    if (!lines.ok()) return lines.status();
    return Add(node, *lines, matrix, style);
  }

  // A length in the units of the drawing; a share of nothing that is known counts as nothing.
  static double Length(const xmlNode* node, const char* name, double otherwise) {
    static constexpr std::pair<absl::string_view, double> kUnits[] = {
        {"px", 1},         {"pt", 4.0 / 3}, {"pc", 16}, {"mm", 96 / 25.4},
        {"cm", 96 / 2.54}, {"in", 96},      {"em", 16}};
    const std::string text = Attribute(node, name);
    absl::string_view rest = text;
    double value = 0;
    if (!TakeNumber(&rest, &value)) return otherwise;
    rest = absl::StripAsciiWhitespace(rest);
    for (const auto& [unit, factor] : kUnits) {
      if (rest == unit) return value * factor;
    }
    return rest == "%" ? otherwise : value;
  }

  absl::StatusOr<Matrix2> TransformOf(const xmlNode* node) const {
    const std::string text = Attribute(node, "transform");
    absl::string_view rest = text;
    Matrix2 matrix;
    while (true) {
      while (!rest.empty() &&
             (rest[0] == ',' || absl::ascii_isspace(static_cast<unsigned char>(rest[0]))))
        rest.remove_prefix(1);
      if (rest.empty()) return matrix;
      const size_t open = rest.find('(');
      const absl::string_view name = absl::StripAsciiWhitespace(rest.substr(0, open));
      std::vector<double> n;
      if (open != absl::string_view::npos) rest.remove_prefix(open + 1);
      double number = 0;
      while (n.size() < 6 && TakeNumber(&rest, &number)) n.push_back(number);
      rest = absl::StripLeadingAsciiWhitespace(rest);
      const bool ended = open != absl::string_view::npos && absl::ConsumePrefix(&rest, ")");
      const auto turn = [](double degrees) { return degrees * std::numbers::pi / 180; };
      if (ended && name == "matrix" && n.size() == 6) {
        matrix = matrix * Matrix2{n[0], n[1], n[2], n[3], n[4], n[5]};
      } else if (ended && name == "translate" && (n.size() == 1 || n.size() == 2)) {
        matrix = matrix * Matrix2{.e = n[0], .f = n.size() == 2 ? n[1] : 0};
      } else if (ended && name == "scale" && (n.size() == 1 || n.size() == 2)) {
        matrix = matrix * Matrix2{.a = n[0], .d = n.back()};
      } else if (ended && name == "rotate" && (n.size() == 1 || n.size() == 3)) {
        const double c = std::cos(turn(n[0])), s = std::sin(turn(n[0]));
        const double x = n.size() == 3 ? n[1] : 0, y = n.size() == 3 ? n[2] : 0;
        matrix = matrix * Matrix2{.e = x, .f = y} * Matrix2{c, s, -s, c, 0, 0} *
                 Matrix2{.e = -x, .f = -y};
      } else if (ended && name == "skewX" && n.size() == 1) {
        matrix = matrix * Matrix2{.c = std::tan(turn(n[0]))};
      } else if (ended && name == "skewY" && n.size() == 1) {
        matrix = matrix * Matrix2{.b = std::tan(turn(n[0]))};
      } else {
        return Wrong(
            node, absl::StrCat("has the transform \"", EscapeForTerminal(text.substr(0, 60)), "\""),
            "matrix, translate, scale, rotate, skewX and skewY with their numbers are read");
      }
    }
  }

  static Polyline Ellipse(double x, double y, double rx, double ry) {
    Polyline line{.points = {{x + rx, y}}, .closed = true};
    const double u = rx * kCircle, v = ry * kCircle;
    AddCubic({x + rx, y}, {x + rx, y + v}, {x + u, y + ry}, {x, y + ry}, &line.points);
    AddCubic({x, y + ry}, {x - u, y + ry}, {x - rx, y + v}, {x - rx, y}, &line.points);
    AddCubic({x - rx, y}, {x - rx, y - v}, {x - u, y - ry}, {x, y - ry}, &line.points);
    AddCubic({x, y - ry}, {x + u, y - ry}, {x + rx, y - v}, {x + rx, y}, &line.points);
    return line;
  }

  static Polyline Rectangle(double x, double y, double w, double h, double rx, double ry) {
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

  absl::StatusOr<std::vector<Polyline>> LinesOf(const xmlNode* node, absl::string_view name) const {
    const auto length = [node](const char* attribute, double otherwise = 0) {
      return Length(node, attribute, otherwise);
    };
    if (name == "path") {
      const size_t room = kMaxModelVertices - part_.positions.size();
      absl::StatusOr<std::vector<Polyline>> lines = ParseSvgPath(Attribute(node, "d"), room);
      if (!lines.ok()) return Wrong(node, "has path data that are wrong", lines.status().message());
      return lines;
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
      const std::string text = Attribute(node, "points");
      absl::string_view rest = text;
      Point2 p;
      while (TakeNumber(&rest, &p.x) && TakeNumber(&rest, &p.y)) line.points.push_back(p);
      if (!absl::StripAsciiWhitespace(rest).empty()) {
        return Wrong(
            node,
            absl::StrCat("has \"", EscapeForTerminal(rest.substr(0, 20)), "\" among its points"),
            "numbers are expected");
      }
      return std::vector<Polyline>{std::move(line)};
    }
    return std::vector<Polyline>();
  }

  absl::Status Add(const xmlNode* node, const std::vector<Polyline>& lines, const Matrix2& matrix,
                   const SvgStyle& style) {
    const std::optional<Rgb> color = style.LineColor();
    if (!color) return absl::OkStatus();
    for (const Polyline& line : lines) {
      if (line.points.size() < 2) continue;
      if (part_.positions.size() + line.points.size() > kMaxModelVertices) {
        return Wrong(node, absl::StrCat("comes after ", part_.positions.size(), " points"),
                     absl::StrCat("at most ", kMaxModelVertices, " are read"));
      }
      const auto first = static_cast<uint32_t>(part_.positions.size());
      for (const Point2& point : line.points) {
        const Point2 p = matrix(point);
        if (!std::isfinite(p.x) || !std::isfinite(p.y)) {
          return Wrong(node, absl::StrCat("has a point at (", p.x, ", ", p.y, ")"),
                       "coordinates must be finite");
        }
        part_.positions.push_back({p.x, -p.y, 0});
        part_.colors.push_back(*color);
      }
      const auto count = static_cast<uint32_t>(line.points.size());
      for (uint32_t i = 0; i + 1 < count + (line.closed ? 1 : 0); ++i) {
        part_.indices.push_back(first + i);
        part_.indices.push_back(first + (i + 1) % count);
      }
    }
    return absl::OkStatus();
  }

  const SourceFile& file_;
  std::map<std::string, xmlNode*> ids_;
  CssRules rules_;
  std::map<std::string, uint64_t> left_out_;
  uint64_t visits_ = 0;
  Part part_;
};

}  // namespace

absl::StatusOr<Model> ReadSvgLines(const SourceFile& file) {
  if (file.bytes.size() > kMostBytes) {
    return FileError(file, absl::StrCat("has ", file.bytes.size(), " bytes"),
                     absl::StrCat("drawings of at most ", kMostBytes, " are read"));
  }
  const std::unique_ptr<xmlParserCtxt, void (*)(xmlParserCtxt*)> context(xmlNewParserCtxt(),
                                                                         xmlFreeParserCtxt);
  if (context == nullptr)
    return absl::ResourceExhaustedError(absl::StrCat(file.path, ": no memory"));
  // Entities stay what they are, and nothing is fetched; the library itself refuses what nests too deep.
  const std::unique_ptr<xmlDoc, void (*)(xmlDoc*)> document(
      xmlCtxtReadMemory(
          context.get(), file.bytes.data(), static_cast<int>(file.bytes.size()), nullptr, nullptr,
          XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING | XML_PARSE_COMPACT),
      xmlFreeDoc);
  if (document == nullptr) {
    const xmlError* error = xmlCtxtGetLastError(context.get());
    const std::string reason = error == nullptr || error->message == nullptr ? "" : error->message;
    return FileError(
        file,
        absl::StrCat("is no well-formed XML (line ", error == nullptr ? 0 : error->line, ": ",
                     EscapeForTerminal(absl::StripAsciiWhitespace(reason).substr(0, 200)), ")"),
        "an SVG drawing is expected");
  }
  xmlNode* root = xmlDocGetRootElement(document.get());
  if (root == nullptr || Name(root) != "svg") {
    return FileError(file,
                     root == nullptr
                         ? "has no element"
                         : absl::StrCat("is XML of <", EscapeForTerminal(Name(root)), ">"),
                     "<svg> is expected");
  }
  return Drawer(file).Draw(root);
}

}  // namespace voxeld::voxelctl
