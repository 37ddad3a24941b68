#include "daemon/wire/text.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "daemon/scene/bounds.h"
#include "daemon/text/fonts.h"
#include "daemon/text/line_break.h"
#include "daemon/text/stroke_font.h"
#include "daemon/wire/color_scale.h"
#include "daemon/wire/curves.h"
#include "daemon/wire/fields.h"
#include "daemon/wire/shapes.h"
#include "gpu/primitives/polygon.h"
#include "gpu/primitives/prism.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::Vector;

constexpr size_t kMostBytes = 64 << 10;
constexpr double kFlatness = 1.0 / 1500;  // maximum error of flattened outlines, in capital heights
constexpr const char* kStrokeFont = "futural";
constexpr double kStrokeLine = 1.6;  // line spacing of stroke fonts, in capital heights

// The placement of a text: maps letters' x, y and z, in capital heights, to the primitive's
// coordinates.
struct Place {
  Vector origin, right, up, facing;  // as long as the height

  Vector At(double x, double y) const { return origin + x * right + y * up; }
  gpu::Affine Map(double x, double y) const {
    const Vector at = At(x, y);
    gpu::Affine map;
    for (int a = 0; a < 3; ++a) {
      map.m[a * 4] = right[a];
      map.m[a * 4 + 1] = up[a];
      map.m[a * 4 + 2] = facing[a];
      map.m[a * 4 + 3] = at[a];
    }
    return map;
  }
};

MaybeFault ToPlace(const FieldPath& path, const v1::Text& in, Place* out) {
  if (auto fault = CheckPositive(FieldPath(path, "height"), in.height())) return fault;
  Vector origin, facing = {0, 0, 1}, toward, up, left;
  if (auto fault = ToVector(FieldPath(path, "position"), in.position(), &origin)) return fault;
  if (in.has_facing()) {
    if (auto fault = ToVector(FieldPath(path, "facing"), in.facing(), &facing)) return fault;
  }
  if (auto fault = ToVector(FieldPath(path, "up"), in.up(), &toward)) return fault;
  if (in.has_up()) {
    if (!gpu::FrameOf(facing, toward, &up, &left)) {
      return Fault{FieldPath(path, "up").ToString(), Reason::kInvalidValue,
                   "lies along facing, or one of the two is 0; give two directions"};
    }
  } else if (!gpu::FrameOf(facing, {0, 1, 0}, &up, &left) &&
             !gpu::FrameOf(facing, {0, 0, 1}, &up, &left)) {
    return Fault{FieldPath(path, "facing").ToString(), Reason::kInvalidValue,
                 "has no direction; give one that is not 0"};
  }
  const double height = in.height();
  *out = {origin, -height * left, height * up, (height / gpu::implicit::Length(facing)) * facing};
  return {};
}

struct Wording {
  text::Layout layout;
  double depth = 0;  // in capital heights
};

MaybeFault ToWording(const FieldPath& path, const v1::Text& in, Wording* out) {
  if (in.text().size() > kMostBytes) {
    return Fault{FieldPath(path, "text").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("has ", in.text().size(), " bytes; give at most ", kMostBytes)};
  }
  switch (in.alignment()) {
    case v1::Text::ALIGNMENT_UNSPECIFIED:
    case v1::Text::LEFT:
      break;
    case v1::Text::CENTER:
      out->layout.alignment = text::Alignment::kCenter;
      break;
    case v1::Text::RIGHT:
      out->layout.alignment = text::Alignment::kRight;
      break;
    default:
      return UnknownEnum(FieldPath(path, "alignment"), in.alignment(), "LEFT, CENTER, RIGHT");
  }
  const std::pair<const char*, double> lengths[] = {
      {"line_spacing", in.line_spacing()}, {"width", in.width()}, {"depth", in.depth()}};
  for (const auto& [name, value] : lengths) {
    if (auto fault = CheckNotNegative(FieldPath(path, name), value)) return fault;
  }
  if (in.depth() > 0 && in.style() != v1::Text::STYLE_UNSPECIFIED &&
      in.style() != v1::Text::FILLED) {
    return Fault{FieldPath(path, "depth").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(in.depth()), ", but only FILLED letters have one")};
  }
  out->layout.font = in.font();
  out->layout.line_spacing = in.line_spacing() == 0 ? 1 : in.line_spacing();
  out->layout.width = in.width() / in.height();
  out->depth = in.depth() / in.height();
  return {};
}

Fault FromStatus(const FieldPath& path, const char* field, const absl::Status& status) {
  const Reason reason = absl::IsNotFound(status)            ? Reason::kNotFound
                        : absl::IsInvalidArgument(status)   ? Reason::kInvalidValue
                        : absl::IsResourceExhausted(status) ? Reason::kQuotaExceeded
                                                            : Reason::kUnimplemented;
  return {FieldPath(path, field).ToString(), reason, std::string(status.message())};
}

// Converts a contour's curves to straight lines that deviate by at most kFlatness. Its last point
// is its first.
void Flatten(const text::Contour& contour, std::vector<Vector>* out) {
  for (size_t i = 0; i + 4 <= contour.size(); i += 4) {
    Vector p[4];
    for (size_t k = 0; k < 4; ++k) p[k] = {contour[i + k].x, contour[i + k].y, 0};
    const double parts = gpu::PartsOfSpan(p, kFlatness);
    for (double k = 0; k < parts; ++k) out->push_back(gpu::OnSpan(p, k / parts));
  }
}

// Converts one letter, flat or solid, in its own coordinates.
MaybeFault ToLetter(const FieldPath& path, const text::Glyph& glyph, double depth,
                    const ShapeContext& context, GeometryData* out) {
  std::vector<Vector> points;
  std::vector<uint32_t> ends;
  for (const text::Contour& contour : glyph.contours) {
    Flatten(contour, &points);
    ends.push_back(static_cast<uint32_t>(points.size()));
  }
  if (points.size() > context.context.limits.max_boundary_points) {
    return Fault{
        path.ToString(), Reason::kQuotaExceeded,
        absl::StrCat("has a letter of ", points.size(), " vertices; max_boundary_points is ",
                     context.context.limits.max_boundary_points)};
  }
  gpu::implicit::Graph graph;
  if (depth > 0) {
    out->record.fill = gpu::Fill::kSolid;
    return ToField(path, context, graph, gpu::Prism{points, ends, depth}.Make(graph), out);
  }
  return ToField(path, context, graph, gpu::Polygon{points, ends}.Make(graph), out);
}

// Sets the bounds of all parts, without thickness.
void SetBounds(const Place& place, GroupData* out) {
  bool first = true;
  for (int a = 0; a < 3; ++a) out->min[a] = out->max[a] = place.origin[a];  // if it is empty
  for (const GroupData::Part& part : out->parts) {
    Bounds box;
    box.empty = false;
    std::copy_n(part.geometry->min, 3, box.min);
    std::copy_n(part.geometry->max, 3, box.max);
    const Bounds mapped = MapBounds(part.transform, box);
    for (int a = 0; a < 3; ++a) {
      out->min[a] = first ? mapped.min[a] : std::min(out->min[a], mapped.min[a]);
      out->max[a] = first ? mapped.max[a] : std::max(out->max[a], mapped.max[a]);
    }
    first = false;
  }
}

MaybeFault ToLetters(const FieldPath& path, const text::LaidOut& laid, const Place& place,
                     double depth, const gpu::GeometryRecord& look, const DecodeContext& context,
                     GroupData* out) {
  if (laid.glyphs.size() > context.limits.max_parts_per_object) {
    return Fault{FieldPath(path, "text").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("makes ", laid.glyphs.size(), " letters; max_parts_per_object is ",
                              context.limits.max_parts_per_object)};
  }
  std::map<const text::Glyph*, GeometryPtr> made;
  for (const text::PlacedGlyph& placed : laid.glyphs) {
    GeometryPtr& geometry = made[placed.glyph.get()];
    if (geometry == nullptr) {
      auto data = std::make_shared<GeometryData>();
      data->record = look;
      if (auto fault = ToLetter(path, *placed.glyph, depth, {context, path, nullptr}, data.get())) {
        return fault;
      }
      geometry = std::move(data);
    }
    out->parts.push_back({geometry, place.Map(placed.x, placed.y)});
  }
  std::stable_sort(out->parts.begin(), out->parts.end(), [](const auto& a, const auto& b) {
    return a.geometry.get() < b.geometry.get();
  });
  SetBounds(place, out);
  return {};
}

// Returns: the colour scale in the part's own coordinates. Requires: `scale` has its ends.
v1::ColorScale ScaleOf(const v1::ColorScale& scale, const gpu::Affine& part) {
  const double along[3] = {scale.along().x(), scale.along().y(), scale.along().z()};
  const double square = along[0] * along[0] + along[1] * along[1] + along[2] * along[2];
  Vector rise;  // increase of the number per unit of the part
  double start = 0;
  for (int a = 0; a < 3; ++a) {
    rise = rise + along[a] / square * Vector{part.m[a * 4], part.m[a * 4 + 1], part.m[a * 4 + 2]};
    start += along[a] / square * part.m[a * 4 + 3];
  }
  // If the number is constant along a part, a minimal increase gives practically all of it the
  // number of its beginning.
  constexpr double kLeastRise = 1e-9;
  const double range = scale.high() - scale.low();
  if (!(gpu::implicit::Length(rise) > kLeastRise * std::fabs(range)))
    rise = {0, 0, kLeastRise * std::fabs(range)};
  const Vector sent = 1 / gpu::implicit::Dot(rise, rise) * rise;
  v1::ColorScale own = scale;
  own.mutable_along()->set_x(sent.x);
  own.mutable_along()->set_y(sent.y);
  own.mutable_along()->set_z(sent.z);
  own.set_low(scale.low() - start);
  own.set_high(scale.high() - start);
  return own;
}

// Checks the memory before creating coloured letters: each takes as much as the plain letter, and a
// table. `plain` contains all letters.
MaybeFault CheckColored(const FieldPath& path, const GroupData& plain,
                        const DecodeContext& context) {
  if (context.decoded_bytes == nullptr) return {};
  uint64_t bytes = 0;
  for (const GroupData::Part& part : plain.parts)
    bytes += sizeof(part) + part.geometry->bytes() + sizeof(ScaleTable);
  const uint64_t most = context.limits.max_uncommitted_bytes;
  if (*context.decoded_bytes + bytes <= most) return {};
  return Fault{FieldPath(path, "text").ToString(), Reason::kQuotaExceeded,
               absl::StrCat("makes ", plain.parts.size(), " letters in colours of their own, ",
                            bytes, " bytes after ", *context.decoded_bytes,
                            " of others; max_uncommitted_bytes is ", most)};
}

// Creates letters in the colours of a scale; each has its own geometry. `out` contains the plain
// ones.
MaybeFault ToColoredLetters(const FieldPath& path, const v1::ColorScale& in,
                            const text::LaidOut& laid, const Place& place, double depth,
                            const gpu::GeometryRecord& look, const ShapeContext& context,
                            GroupData* out) {
  v1::ColorScale scale = in;
  ScaleEnds ends;
  if (auto fault = ToScaleEnds(context.scale_path, in, out->min, out->max, &ends)) return fault;
  scale.set_low(ends.low);
  scale.set_high(ends.high);
  if (auto fault = CheckColored(path, *out, context.context)) return fault;
  out->parts.clear();
  for (const text::PlacedGlyph& placed : laid.glyphs) {
    const gpu::Affine map = place.Map(placed.x, placed.y);
    const v1::ColorScale own = ScaleOf(scale, map);
    auto data = std::make_shared<GeometryData>();
    data->record = look;
    if (auto fault = ToLetter(path, *placed.glyph, depth,
                              {context.context, context.scale_path, &own}, data.get())) {
      return fault;
    }
    out->parts.push_back({std::move(data), map});
  }
  return {};
}
// Converts the lines of a stroke font to straight spans, with line breaks as in any text.
MaybeFault ToStrokes(const FieldPath& path, const v1::Text& in, const text::Layout& layout,
                     const Place& place, const DecodeContext& context, gpu::Spans* out) {
  const auto found = context.fonts->Strokes(layout.font.empty() ? kStrokeFont : layout.font);
  if (!found.ok()) return FromStatus(path, "font", found.status());
  const text::StrokeFont& font = **found;
  if (in.text().size() > layout.most) {
    return FromStatus(path, "text",
                      absl::ResourceExhaustedError(absl::StrCat(
                          "has ", in.text().size(), " characters; give at most ", layout.most)));
  }
  for (size_t i = 0; i < in.text().size(); ++i) {
    const auto c = static_cast<unsigned char>(in.text()[i]);
    if (c == '\n' || (c >= 0x20 && c < 0x7F)) continue;
    return Fault{
        FieldPath(path, "text").ToString(), Reason::kInvalidValue,
        absl::StrCat("has a character at byte ", i,
                     " that stroke fonts have not; give ASCII, or the style FILLED or OUTLINE")};
  }
  double base = 0;
  const std::vector<std::string> paragraphs = absl::StrSplit(in.text(), '\n');
  for (const std::string& paragraph : paragraphs) {
    std::vector<text::Word> words;
    for (size_t i = 0; i < paragraph.size();) {
      size_t end = i + 1;
      while (end < paragraph.size() && (paragraph[end] == ' ') == (paragraph[i] == ' ')) ++end;
      const double advance =
          static_cast<double>(font.Lay(std::string_view(paragraph).substr(i, end - i)).width);
      words.push_back({i, end, advance, paragraph[i] == ' '});
      i = end;
    }
    for (const text::TextLine& line : text::BreakLines(words, layout.width)) {
      if (line.begin < line.end) {
        const size_t begin = words[line.begin].begin, end = words[line.end - 1].end;
        const text::StrokeFont::Line laid =
            font.Lay(std::string_view(paragraph).substr(begin, end - begin));
        const double shift = layout.alignment == text::Alignment::kLeft     ? 0.0
                             : layout.alignment == text::Alignment::kCenter ? -0.5
                                                                            : -1.0;
        const double from = shift * static_cast<double>(laid.width);
        for (const text::Stroke& stroke : laid.strokes) {
          const auto at = [&](size_t i) {
            return place.At(from + static_cast<double>(stroke[i].x),
                            base + static_cast<double>(stroke[i].y));
          };
          for (size_t i = 0; i + 1 < stroke.size(); ++i) out->Line(at(i), at(i + 1));
        }
      }
      base -= kStrokeLine * layout.line_spacing;
    }
  }
  return {};
}

}  // namespace

MaybeFault ToText(const FieldPath& primitive_path, const v1::Primitive& primitive, uint32_t color,
                  const DecodeContext& context, Content* out) {
  const v1::Text& in = primitive.text();
  const FieldPath path(primitive_path, "text"), scale_path(primitive_path, "color_scale");
  Place place;
  Wording wording;
  gpu::GeometryRecord look;
  look.color = color;
  const bool lines = in.style() == v1::Text::OUTLINE || in.style() == v1::Text::STROKES;
  if (!lines && in.style() != v1::Text::STYLE_UNSPECIFIED && in.style() != v1::Text::FILLED) {
    return UnknownEnum(FieldPath(path, "style"), in.style(), "FILLED, OUTLINE, STROKES");
  }
  if (auto fault = ToPlace(path, in, &place)) return fault;
  if (auto fault = ToWording(path, in, &wording)) return fault;
  if (auto fault = ToRule(path, in.rule(), &look)) return fault;
  if (auto fault = ToThickness(FieldPath(path, "thickness"), in.thickness(), context, &look)) {
    return fault;
  }
  if (!primitive.color_scale().scalars().empty()) {
    return Fault{FieldPath(scale_path, "scalars").ToString(), Reason::kInvalidValue,
                 "is given, but the shape has no vertices; give along"};
  }
  if (context.fonts == nullptr) {
    return Unimplemented(path, "there are no fonts here; draw its lines as segments");
  }
  wording.layout.most = context.limits.max_parts_per_object;
  gpu::Spans spans;
  text::LaidOut laid;
  if (in.style() == v1::Text::STROKES) {
    if (auto fault = ToStrokes(path, in, wording.layout, place, context, &spans)) return fault;
  } else {
    absl::StatusOr<text::LaidOut> found = context.fonts->Lay(in.text(), wording.layout);
    if (!found.ok()) {
      const bool font = absl::IsNotFound(found.status()) || absl::IsUnavailable(found.status());
      return FromStatus(path, font ? "font" : "text", found.status());
    }
    laid = *std::move(found);
  }
  if (!lines) {
    auto group = std::make_shared<GroupData>();
    // Letters use capital heights as their unit.
    if (look.thickness_unit == gpu::ThicknessUnit::kUnits)
      look.thickness /= static_cast<float>(in.height());
    if (auto fault = ToLetters(path, laid, place, wording.depth, look, context, group.get())) {
      return fault;
    }
    if (primitive.has_color_scale()) {
      if (auto fault = ToColoredLetters(path, primitive.color_scale(), laid, place, wording.depth,
                                        look, {context, scale_path, nullptr}, group.get())) {
        return fault;
      }
    }
    group->kind = "text";
    group->as_sent = primitive.SerializeAsString();
    group->color = color;
    *out = GroupPtr(std::move(group));
    return {};
  }
  for (const text::PlacedGlyph& placed : laid.glyphs) {
    for (const text::Contour& contour : placed.glyph->contours) {
      for (size_t i = 0; i + 4 <= contour.size(); i += 4) {
        const auto at = [&](size_t k) {
          return place.At(placed.x + contour[i + k].x, placed.y + contour[i + k].y);
        };
        spans.Curve(at(0), at(1), at(2), at(3));
      }
    }
  }
  auto data = std::make_shared<GeometryData>();
  data->record = look;
  for (int a = 0; a < 3; ++a) data->min[a] = data->max[a] = place.origin[a];  // if it is empty
  if (auto fault = SetSpans(path, spans, context, data.get())) return fault;
  if (primitive.has_color_scale() && data->record.vertex_count != 0) {
    if (auto fault = ToVertexColors(scale_path, primitive.color_scale(), context, data.get())) {
      return fault;
    }
  }
  data->kind = "text";
  data->as_sent = primitive.SerializeAsString();
  *out = GeometryPtr(std::move(data));
  return {};
}

}  // namespace voxeld::daemon::wire
