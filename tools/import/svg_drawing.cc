#include "tools/import/svg_drawing.h"

#include <libxml/parser.h>
#include <libxml/tree.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
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
#include "common/text/printable.h"
#include "tools/import/svg_fill.h"
#include "tools/import/svg_layers.h"
#include "tools/import/svg_path.h"
#include "tools/import/svg_shapes.h"
#include "tools/import/svg_style.h"
#include "tools/import/svg_transform.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostBytes = 64 << 20;
constexpr int kMostDepth = 100;
// Work, as bytes that are parsed: again wherever they are used, so that the file's size does not bound it.
constexpr uint64_t kMostVisits = 1'000'000, kBytesOfAVisit = 128, kBytesOfARule = 32,
                   kBytesOfAStep = 16;  // past an attribute, a class or a child
// What uses nothing twice comes to less, unless its attributes are many and next to empty.
constexpr uint64_t kMostWork = kMostVisits * kBytesOfAVisit + 2 * kMostBytes;
constexpr double kLargest = 1e15;   // further out nothing is told apart
constexpr int kMostReferences = 8;  // from one gradient to another

class Drawer {
 public:
  explicit Drawer(const SourceFile& file) : file_(file) {}

  absl::StatusOr<Model> Draw(xmlNode* root) {
    Collect(root, 0);
    if (absl::Status status = Visit(root, Matrix2(), SvgStyle(), 0); !status.ok()) return status;
    if (work_ > kMostWork) return Endless(root);
    if (layers_.empty()) {
      return FileError(file_, "has no line that is to be seen",
                       "at least one path or shape is expected");
    }
    LayeredParts layered = ToParts(std::move(layers_));
    Model model;
    model.path = file_.path;
    model.format = "SVG";
    model.up = Up::kY;
    model.lit_already = true;
    model.parts = std::move(layered.parts);
    std::vector<std::string> notes, counts;
    if (!layered.note.empty()) notes.push_back(layered.note);
    if (unfilled_ > 0) {
      notes.push_back(absl::StrCat(unfilled_, " that cross themselves too often are not filled"));
    }
    counts.reserve(left_out_.size());
    for (const auto& [what, count] : left_out_) counts.push_back(absl::StrCat(count, " ", what));
    if (!counts.empty()) {
      notes.push_back(
          absl::StrCat("left out are elements of the kinds ", absl::StrJoin(counts, ", ")));
    }
    if (!notes.empty()) model.note = absl::StrCat(file_.path, ": ", absl::StrJoin(notes, "; "));
    return model;
  }

 private:
  absl::Status Wrong(const xmlNode* node, absl::string_view found,
                     absl::string_view expected) const {
    return FileError(file_,
                     absl::StrCat("line ", xmlGetLineNo(node), ": <", SvgName(node), "> ", found),
                     expected);
  }

  // Ids, and style sheets, wherever they stand.
  void Collect(xmlNode* node, int depth) {
    for (; node != nullptr && depth < kMostDepth * 3; node = node->next) {
      if (node->type != XML_ELEMENT_NODE) continue;
      const std::string id = SvgAttribute(node, "id");
      if (!id.empty()) ids_.emplace(id, node);
      if (SvgName(node) == "style") {
        if (xmlChar* text = xmlNodeGetContent(node); text != nullptr) {
          AddCssRules(reinterpret_cast<const char*>(text), &rules_);
          xmlFree(text);
        }
      }
      Collect(node->children, depth + 1);
    }
  }

  absl::Status Endless(const xmlNode* node) const {
    return Wrong(node, "stands in elements that are within, or use, each other without end",
                 absl::StrCat("at most ", kMostDepth, " deep are read"));
  }

  void Charge(uint64_t bytes) const { work_ += bytes; }

  // All that may be parsed of the node itself.
  void ChargeAttributes(const xmlNode* node) const {
    for (const xmlAttr* attribute = node->properties; attribute != nullptr;
         attribute = attribute->next) {
      Charge(kBytesOfAStep);
      for (const xmlNode* text = attribute->children; text != nullptr; text = text->next)
        Charge(static_cast<uint64_t>(xmlStrlen(text->content)));
    }
  }

  SvgStyle StyleOf(const xmlNode* node, SvgStyle style) const {
    Charge(kBytesOfAVisit);
    ChargeAttributes(node);
    for (const char* property : kSvgProperties) style.Set(property, SvgAttribute(node, property));
    const auto apply = [&](const std::string& selector) {
      Charge(kBytesOfAStep);
      const auto rule = rules_.find(selector);
      if (rule == rules_.end()) return;
      Charge(kBytesOfARule + rule->second.size());
      style.SetAll(rule->second);
    };
    if (!rules_.empty()) {
      apply(std::string(SvgName(node)));
      for (const absl::string_view word :
           absl::StrSplit(SvgAttribute(node, "class"), ' ', absl::SkipWhitespace()))
        apply(absl::StrCat(".", word));
      apply(absl::StrCat("#", SvgAttribute(node, "id")));
    }
    style.SetAll(SvgAttribute(node, "style"));
    return style;
  }

  absl::Status Visit(xmlNode* node, const Matrix2& outer, const SvgStyle& outer_style, int depth) {
    if (depth > kMostDepth || ++visits_ > kMostVisits || work_ > kMostWork) return Endless(node);
    const SvgStyle style = StyleOf(node, outer_style.Inherited());
    if (!style.displayed) return absl::OkStatus();
    const absl::string_view name = SvgName(node);
    const std::string transform = SvgAttribute(node, "transform");
    const std::optional<Matrix2> own = ParseSvgTransform(transform);
    if (!own) {
      return Wrong(
          node,
          absl::StrCat("has the transform \"", EscapeForTerminal(transform.substr(0, 60)), "\""),
          "matrix, translate, scale, rotate, skewX and skewY with their numbers are read");
    }
    Matrix2 matrix = outer * *own;
    if (name == "g" || name == "a" || name == "switch" || name == "svg" || name == "symbol") {
      if (name == "svg" && depth > 0) {
        matrix = matrix * Matrix2{.e = SvgLength(node, "x", 0), .f = SvgLength(node, "y", 0)};
      }
      for (xmlNode* child = node->children; child != nullptr; child = child->next) {
        Charge(kBytesOfAStep);
        if (child->type != XML_ELEMENT_NODE || SvgName(child) == "symbol") continue;
        if (absl::Status status = Visit(child, matrix, style, depth + 1); !status.ok())
          return status;
      }
      return absl::OkStatus();
    }
    if (name == "use") {
      const std::string href = SvgReference(node);
      const auto used = href.size() > 1 && href[0] == '#' ? ids_.find(href.substr(1)) : ids_.end();
      if (used == ids_.end()) {
        return Wrong(node, absl::StrCat("uses \"", EscapeForTerminal(href.substr(0, 60)), "\""),
                     "an id of this file is expected, as #ID");
      }
      return Visit(used->second,
                   matrix * Matrix2{.e = SvgLength(node, "x", 0), .f = SvgLength(node, "y", 0)},
                   style, depth + 1);
    }
    if (name == "text" || name == "image" || name == "foreignObject" || name == "clipPath" ||
        name == "mask") {
      ++left_out_[std::string(name)];
      return absl::OkStatus();
    }
    if (!style.visible) return absl::OkStatus();
    absl::StatusOr<std::vector<Polyline>> lines = SvgShape(node, kMaxModelVertices - points_);
    if (!lines.ok()) {
      return absl::Status(lines.status().code(),
                          absl::StrCat(file_.path, ": line ", xmlGetLineNo(node), ": <", name, "> ",
                                       lines.status().message()));
    }
    return Add(node, *std::move(lines), matrix, style);
  }

  // The mean of a gradient's stops; nothing if it has none.
  std::optional<Rgb> GradientColor(absl::string_view paint) const {
    std::string id(paint.substr(0, paint.find(')')));
    for (int i = 0; i < kMostReferences; ++i) {
      id.erase(std::remove_if(id.begin(), id.end(), [](char c) { return c == '"' || c == '\''; }),
               id.end());
      const auto found = id.size() > 1 && id[0] == '#' ? ids_.find(id.substr(1)) : ids_.end();
      if (found == ids_.end()) return std::nullopt;
      double r = 0, g = 0, b = 0, count = 0;
      for (const xmlNode* stop = found->second->children; stop != nullptr && work_ <= kMostWork;
           stop = stop->next) {
        Charge(kBytesOfAStep);
        if (stop->type != XML_ELEMENT_NODE || SvgName(stop) != "stop") continue;
        const std::optional<Rgb> color = ParseCssColor(StyleOf(stop, SvgStyle()).stop_color);
        if (!color) continue;
        r += color->r, g += color->g, b += color->b;
        ++count;
      }
      if (count > 0) {
        return Rgb{static_cast<uint8_t>(r / count), static_cast<uint8_t>(g / count),
                   static_cast<uint8_t>(b / count)};
      }
      id = SvgReference(found->second);
    }
    return std::nullopt;
  }

  // Nothing of what is not painted.
  std::optional<Rgb> ColorOf(absl::string_view paint, const SvgStyle& style) const {
    if (absl::ConsumePrefix(&paint, "url(")) {
      const auto known = gradients_.find(paint);
      const std::optional<Rgb> color =
          known != gradients_.end()
              ? known->second
              : gradients_.emplace(std::string(paint), GradientColor(paint)).first->second;
      if (color) return color;
      // Behind it may stand what is to be had without it. Patterns have no colour of their own.
      const size_t end = paint.find(')');
      paint =
          end == absl::string_view::npos ? "" : absl::StripAsciiWhitespace(paint.substr(end + 1));
      if (paint.empty()) return Rgb{255, 255, 255};
    }
    if (absl::EqualsIgnoreCase(paint, "currentcolor")) paint = style.color;
    if (paint == "none" || paint == "transparent") return std::nullopt;
    return ParseCssColor(paint).value_or(Rgb{255, 255, 255});
  }

  // All of the curves as lines, from one point to the next.
  static SvgLayer Lines(const std::vector<Polyline>& curves) {
    SvgLayer layer;
    for (const Polyline& curve : curves) {
      const auto first = static_cast<uint32_t>(layer.points.size());
      const auto count = static_cast<uint32_t>(curve.points.size());
      if (count < 2) continue;
      layer.points.insert(layer.points.end(), curve.points.begin(), curve.points.end());
      for (uint32_t i = 0; i + 1 < count + (curve.closed ? 1 : 0); ++i) {
        layer.segments.push_back(first + i);
        layer.segments.push_back(first + (i + 1) % count);
      }
    }
    return layer;
  }

  void Put(SvgLayer layer, const Rgb& color, double opacity, bool stroke) {
    layer.color = color;
    layer.opacity = opacity;
    layer.stroke = stroke;
    points_ += layer.points.size();
    if (!layer.points.empty()) layers_.push_back(std::move(layer));
  }

  // As much of what is filled as is given, and its edge; what has no area is a line.
  void Fill(std::vector<Polyline> curves, const Rgb& color, double opacity, bool stroked,
            FillRule rule) {
    for (Polyline& curve : curves) curve.closed |= curve.points.size() > 2;
    std::optional<Triangles> filled = FillCurves(curves, rule, &budget_);
    unfilled_ += filled ? 0 : 1;
    const bool area = filled && !filled->indices.empty();
    SvgLayer layer = area || !stroked ? Lines(curves) : SvgLayer();
    if (area) {
      const auto first = static_cast<uint32_t>(layer.points.size());
      layer.points.insert(layer.points.end(), filled->points.begin(), filled->points.end());
      for (const uint32_t index : filled->indices) layer.triangles.push_back(first + index);
    }
    Put(std::move(layer), color, opacity, !area);
  }

  absl::Status Add(const xmlNode* node, std::vector<Polyline> curves, const Matrix2& matrix,
                   const SvgStyle& style) {
    const double opacity = style.outer_opacity * style.opacity;
    const std::optional<Rgb> fill = ColorOf(style.fill, style),
                             stroke = ColorOf(style.stroke, style);
    const bool filled = fill && opacity * style.fill_opacity > 0,
               stroked = stroke && opacity * style.stroke_opacity > 0;
    for (Polyline& curve : curves) {
      for (Point2& p : curve.points) {
        p = matrix(p);
        if (!(std::abs(p.x) <= kLargest) || !(std::abs(p.y) <= kLargest)) {
          return Wrong(node, absl::StrCat("has a point at (", p.x, ", ", p.y, ")"),
                       "coordinates must be finite");
        }
      }
    }
    if (stroked && filled) {
      SvgLayer lines = Lines(curves);
      Fill(std::move(curves), *fill, opacity * style.fill_opacity, true,
           style.even_odd ? FillRule::kEvenOdd : FillRule::kNonZero);
      Put(std::move(lines), *stroke, opacity * style.stroke_opacity, true);
    } else if (filled) {
      Fill(std::move(curves), *fill, opacity * style.fill_opacity, false,
           style.even_odd ? FillRule::kEvenOdd : FillRule::kNonZero);
    } else if (stroked) {
      Put(Lines(curves), *stroke, opacity * style.stroke_opacity, true);
    }
    // An area has its points twice, those of its edge among them.
    if (points_ <= kMaxModelVertices / 2) return absl::OkStatus();
    return Wrong(node, absl::StrCat("comes after ", points_, " points"),
                 absl::StrCat("at most ", kMaxModelVertices / 2, " are read"));
  }

  const SourceFile& file_;
  std::map<std::string, xmlNode*> ids_;
  CssRules rules_;
  std::map<std::string, uint64_t> left_out_;
  uint64_t visits_ = 0;
  mutable uint64_t work_ = 0;                                                 // in bytes
  mutable std::map<std::string, std::optional<Rgb>, std::less<>> gradients_;  // by what names them
  uint64_t points_ = 0, unfilled_ = 0;
  FillBudget budget_;
  std::vector<SvgLayer> layers_;
};

}  // namespace

absl::StatusOr<Model> ReadSvgDrawing(const SourceFile& file) {
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
  if (root == nullptr || SvgName(root) != "svg") {
    return FileError(file,
                     root == nullptr
                         ? "has no element"
                         : absl::StrCat("is XML of <", EscapeForTerminal(SvgName(root)), ">"),
                     "<svg> is expected");
  }
  return Drawer(file).Draw(root);
}

}  // namespace voxeld::voxelctl
