#include "daemon/text/glyph_outline.h"

#include FT_OUTLINE_H

#include <utility>

namespace voxeld::text {
namespace {

// Receives a contour from FreeType.
struct Reader {
  double scale;
  std::vector<Contour> contours;
  OutlinePoint at, begin;

  OutlinePoint Point(const FT_Vector* p) const {
    return {static_cast<double>(p->x) * scale, static_cast<double>(p->y) * scale};
  }
  void Curve(OutlinePoint a, OutlinePoint b, OutlinePoint end) {
    contours.back().insert(contours.back().end(), {at, a, b, end});
    at = end;
  }
  static OutlinePoint Mix(OutlinePoint a, OutlinePoint b, double t) {
    return {a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t};
  }
  void Line(OutlinePoint end) {
    if (end.x == at.x && end.y == at.y) return;
    Curve(Mix(at, end, 1.0 / 3), Mix(at, end, 2.0 / 3), end);
  }
  void Close() {
    if (contours.empty()) return;
    Line(begin);
    if (contours.back().empty()) contours.pop_back();
  }

  static int MoveTo(const FT_Vector* to, void* self) {
    auto& r = *static_cast<Reader*>(self);
    r.Close();
    r.contours.emplace_back();
    r.at = r.begin = r.Point(to);
    return 0;
  }
  static int LineTo(const FT_Vector* to, void* self) {
    auto& r = *static_cast<Reader*>(self);
    r.Line(r.Point(to));
    return 0;
  }
  static int ConicTo(const FT_Vector* handle, const FT_Vector* to, void* self) {
    auto& r = *static_cast<Reader*>(self);
    const OutlinePoint h = r.Point(handle), end = r.Point(to);
    r.Curve(Mix(r.at, h, 2.0 / 3), Mix(end, h, 2.0 / 3), end);
    return 0;
  }
  static int CubicTo(const FT_Vector* a, const FT_Vector* b, const FT_Vector* to, void* self) {
    auto& r = *static_cast<Reader*>(self);
    r.Curve(r.Point(a), r.Point(b), r.Point(to));
    return 0;
  }
};

}  // namespace

std::vector<Contour> ContoursOf(FT_Outline& outline, double scale) {
  Reader reader{scale, {}, {}, {}};
  const FT_Outline_Funcs functions = {
      Reader::MoveTo, Reader::LineTo, Reader::ConicTo, Reader::CubicTo, 0, 0};
  if (FT_Outline_Decompose(&outline, &functions, &reader) != 0) return {};
  reader.Close();
  return std::move(reader.contours);
}

}  // namespace voxeld::text
