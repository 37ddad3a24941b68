#include "tools/import/dxf_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/import/mesh_parts.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kDxfCrease = 25;    // degrees; sharper edges stay edges
constexpr int kArcSteps = 72;        // of a circle
constexpr int kMostBlockDepth = 16;  // blocks within each other
constexpr uint64_t kMostInserts = 1'000'000;
constexpr uint64_t kMostDxfBytes = uint64_t{512} << 20;
constexpr size_t kMostTypes = 64;  // of entities, that are counted by name
constexpr int kByBlock = 0, kByLayer = 256, kForeground = 7;

// A group of the file: a code, which gives the meaning of the value, and the value.
struct DxfPair {
  int code = 0;
  absl::string_view value;
};

// The groups of an entity, a block or a table entry, from one group 0 to the next.
struct DxfRecord {
  absl::string_view type;
  uint64_t line = 0;
  std::vector<DxfPair> pairs;

  // Returns the first value with the code; empty if there is none.
  absl::string_view Text(int code) const {
    const auto found = std::find_if(pairs.begin(), pairs.end(),
                                    [code](const DxfPair& pair) { return pair.code == code; });
    return found == pairs.end() ? absl::string_view() : found->value;
  }
  bool Has(int code) const {
    return std::any_of(pairs.begin(), pairs.end(),
                       [code](const DxfPair& pair) { return pair.code == code; });
  }
  double Number(int code, double otherwise = 0) const {
    double number = 0;
    return absl::SimpleAtod(Text(code), &number) && std::isfinite(number) ? number : otherwise;
  }
  int Integer(int code, int otherwise = 0) const {
    int number = 0;
    return absl::SimpleAtoi(Text(code), &number) ? number : otherwise;
  }
  // Returns the point whose x has the code; y has the code + 10 and z the code + 20.
  Point3 Point(int code) const { return {Number(code), Number(code + 10), Number(code + 20)}; }
};

struct DxfEntity {
  DxfRecord record;
  std::vector<DxfRecord> vertices;  // of a POLYLINE
};

struct DxfBlock {
  Point3 base;
  std::vector<DxfEntity> entities;
};

struct DxfLayer {
  int color = kForeground;
  std::optional<Rgb> true_color;
  bool hidden = false;
};

struct DxfDrawing {
  std::map<std::string, DxfLayer> layers;
  std::map<std::string, DxfBlock> blocks;
  std::vector<DxfEntity> entities;
  double unit = 0;  // in metres
  bool has_end = false;
};

// ------------------------------------------------------------------------------------------- colours

Rgb TrueColor(uint32_t value) {
  return {static_cast<uint8_t>(value >> 16), static_cast<uint8_t>(value >> 8),
          static_cast<uint8_t>(value)};
}

// Returns a colour of AutoCAD's table: nine colours, 24 hues in ten shades each, and six greys.
Rgb IndexedColor(int index) {
  static constexpr Rgb kFirst[] = {{255, 255, 255}, {255, 0, 0},    {255, 255, 0}, {0, 255, 0},
                                   {0, 255, 255},   {0, 0, 255},    {255, 0, 255}, {255, 255, 255},
                                   {128, 128, 128}, {192, 192, 192}};
  static constexpr uint8_t kGreys[] = {51, 80, 105, 130, 190, 255};
  if (index < 0 || index > 255) return kFirst[kForeground];
  if (index < 10) return kFirst[index];
  if (index >= 250) {
    const uint8_t grey = kGreys[index - 250];
    return {grey, grey, grey};
  }
  static constexpr double kShades[] = {1, 0.65, 0.5, 0.3, 0.15};
  const double hue = (index / 10 - 1) / 4.0;  // in sixths of a circle
  const double value = kShades[index % 10 / 2], least = index % 2 == 0 ? 0 : 0.5;
  const auto channel = [&](double shift) {
    const double at = std::fmod(hue + shift, 6);
    const double full = std::clamp(std::abs(at - 3) - 1, 0.0, 1.0);
    return static_cast<uint8_t>(std::lround(255 * value * (least + (1 - least) * full)));
  };
  return {channel(0), channel(4), channel(2)};
}

// ------------------------------------------------------------------------------------------- places

// Returns the axes of an entity's plane, computed from its normal by the format's arbitrary axis
// algorithm.
NodeMatrix PlaneOf(const DxfRecord& record) {
  const Point3 z = Direction(
      {record.Number(210, 0), record.Number(220, 0), record.Number(230, record.Has(210) ? 0 : 1)});
  if (z == Point3{} || z == Point3{0, 0, 1}) return kIdentity;
  const bool near_z = std::abs(z.x) < 1 / 64.0 && std::abs(z.y) < 1 / 64.0;
  const Point3 x = Direction(near_z ? Point3{z.z, 0, -z.x} : Point3{-z.y, z.x, 0});
  const Point3 y = {z.y * x.z - z.z * x.y, z.z * x.x - z.x * x.z, z.x * x.y - z.y * x.x};
  return {x.x, y.x, z.x, 0, x.y, y.y, z.y, 0, x.z, y.z, z.z, 0};
}

// The colour and layer that an INSERT passes to the entities in its block.
struct Inherited {
  Rgb color = {255, 255, 255};
  absl::string_view layer = "0";
};

// ------------------------------------------------------------------------------------------- reading

class DxfParser {
 public:
  explicit DxfParser(const SourceFile& file) : file_(file), rest_(file.bytes) {}

  absl::StatusOr<DxfDrawing> Parse() {
    DxfRecord record;
    std::string section, block;
    DxfBlock* open = nullptr;
    while (Next(&record)) {
      if (record.type == "SECTION") {
        section = std::string(record.Text(2));
        if (section == "HEADER") TakeHeader(record);
      } else if (record.type == "ENDSEC") {
        section.clear();
      } else if (record.type == "EOF") {
        drawing_.has_end = true;
        break;
      } else if (section == "TABLES" && record.type == "LAYER") {
        TakeLayer(record);
      } else if (section == "BLOCKS" && record.type == "BLOCK") {
        open = &drawing_.blocks[std::string(record.Text(2))];
        open->base = record.Point(10);
      } else if (section == "BLOCKS" && record.type == "ENDBLK") {
        open = nullptr;
      } else if (section == "ENTITIES" || (section == "BLOCKS" && open != nullptr)) {
        TakeEntity(std::move(record), open == nullptr ? &drawing_.entities : &open->entities);
      }
    }
    if (!status_.ok()) return status_;
    return std::move(drawing_);
  }

 private:
  bool TakePair(DxfPair* pair) {
    if (rest_.empty()) return false;
    absl::string_view code = TakeLine(&rest_);
    ++line_;
    code = absl::StripAsciiWhitespace(code);
    if (code.empty() && rest_.empty()) return false;
    if (!absl::SimpleAtoi(code, &pair->code)) {
      status_ = FileError(
          file_,
          absl::StrCat("line ", line_, " is \"", EscapeForTerminal(code.substr(0, 24)), "\""),
          "a DXF has a whole number, the group code, in every other line");
      return false;
    }
    pair->value = absl::StripAsciiWhitespace(TakeLine(&rest_));
    ++line_;
    return true;
  }

  bool Next(DxfRecord* record) {
    record->pairs.clear();
    // Groups before the first record are comments.
    while (!has_next_) {
      DxfPair pair;
      if (!TakePair(&pair)) return false;
      if (pair.code != 0) continue;
      next_ = pair.value;
      has_next_ = true;
    }
    record->type = next_;
    record->line = line_;
    has_next_ = false;
    for (DxfPair pair; TakePair(&pair);) {
      if (pair.code == 0) {
        next_ = pair.value;
        has_next_ = true;
        break;
      }
      record->pairs.push_back(pair);
    }
    return status_.ok();
  }

  void TakeHeader(const DxfRecord& header) {
    static constexpr double kUnits[] = {0,    0.0254, 0.3048,  1609.344, 0.001,  0.01,
                                        1,    1000,   2.54e-8, 2.54e-5,  0.9144, 1e-10,
                                        1e-9, 1e-6,   0.1,     10,       100};
    bool is_units = false;
    for (const DxfPair& pair : header.pairs) {
      int number = 0;
      if (pair.code == 9) {
        is_units = pair.value == "$INSUNITS";
      } else if (is_units && pair.code == 70 && absl::SimpleAtoi(pair.value, &number) &&
                 number >= 0 && static_cast<size_t>(number) < std::size(kUnits)) {
        drawing_.unit = kUnits[number];
      }
    }
  }

  void TakeLayer(const DxfRecord& record) {
    DxfLayer& layer = drawing_.layers[std::string(record.Text(2))];
    const int color = record.Integer(62, kForeground);
    layer.color = std::abs(color);
    // A negative colour means that the layer is off; the first bit means that it is frozen.
    layer.hidden = color < 0 || (record.Integer(70) & 1) != 0;
    if (record.Has(420)) layer.true_color = TrueColor(static_cast<uint32_t>(record.Integer(420)));
  }

  // Checks that coordinates, lengths, angles and directions are finite numbers.
  bool CheckNumbers(const DxfRecord& record) {
    for (const DxfPair& pair : record.pairs) {
      const bool is_number =
          (pair.code >= 10 && pair.code < 60) || (pair.code >= 210 && pair.code < 240);
      double number = 0;
      if (!is_number || (absl::SimpleAtod(pair.value, &number) && std::isfinite(number))) continue;
      status_ = FileError(
          file_,
          absl::StrCat("the entity in line ", record.line, " has \"",
                       EscapeForTerminal(pair.value.substr(0, 24)), "\" for the group ", pair.code),
          "a finite number is expected");
      return false;
    }
    return true;
  }

  void TakeEntity(DxfRecord record, std::vector<DxfEntity>* out) {
    const bool is_polyline =
        !out->empty() && out->back().record.type == "POLYLINE" && !polyline_ended_;
    if (record.type == "VERTEX" && is_polyline) {
      if (!CheckNumbers(record)) return;
      out->back().vertices.push_back(std::move(record));
    } else if (record.type == "SEQEND") {
      polyline_ended_ = true;
    } else if (CheckNumbers(record)) {
      polyline_ended_ = false;
      out->push_back({std::move(record), {}});
    }
  }

  const SourceFile& file_;
  absl::string_view rest_, next_;
  bool has_next_ = false, polyline_ended_ = false;
  uint64_t line_ = 0;
  absl::Status status_;
  DxfDrawing drawing_;
};

// ------------------------------------------------------------------------------------------- building

class DxfBuilder {
 public:
  DxfBuilder(const SourceFile& file, const DxfDrawing& drawing, Model* model)
      : file_(file), drawing_(drawing), model_(model) {
    lines_.kind = Kind::kSegments;
    points_.kind = Kind::kPoints;
  }

  absl::Status Build() {
    Add(drawing_.entities, kIdentity, {}, 0);
    if (!status_.ok()) return status_;
    AddLeftOut("hidden entities", hidden_, model_);
    AddLeftOut("entities of paper space", paper_, model_);
    AddLeftOut("insertions of missing blocks", missing_, model_);
    for (const auto& [type, count] : unread_)
      AddLeftOut(absl::StrCat("entities of type ", EscapeForTerminal(type)), count, model_);
    Part surface = std::move(surface_).Finish();
    AddLeftOut("triangles without an area", DropEmptyTriangles(&surface), model_);
    for (Part* part : {&surface, &lines_, &points_}) {
      if (part->positions.empty()) continue;
      // If everything has the foreground colour, the file has no colours.
      if (!has_colors_) part->colors.clear();
      if (part->kind == Kind::kTriangles) AddNormals(kDxfCrease, part);
      model_->parts.push_back(std::move(*part));
    }
    if (model_->parts.empty())
      return FileError(file_, "has no entity that is shown",
                       "at least one face, line or point is expected");
    return absl::OkStatus();
  }

 private:
  void Add(const std::vector<DxfEntity>& entities, const NodeMatrix& map,
           const Inherited& inherited, int depth) {
    for (const DxfEntity& entity : entities) {
      if (!status_.ok()) return;
      const DxfRecord& record = entity.record;
      absl::string_view layer = record.Text(8);
      if (layer.empty() || layer == "0") layer = inherited.layer;
      const auto known = drawing_.layers.find(std::string(layer));
      if (record.Integer(67) == 1) {
        ++paper_;
        continue;
      }
      if (record.Integer(60) == 1 || (known != drawing_.layers.end() && known->second.hidden)) {
        ++hidden_;
        continue;
      }
      color_ =
          ColorOf(record, known == drawing_.layers.end() ? nullptr : &known->second, inherited);
      if (record.type == "INSERT") {
        Insert(record, map, {color_, layer}, depth);
      } else {
        Draw(entity, map);
      }
    }
  }

  Rgb ColorOf(const DxfRecord& record, const DxfLayer* layer, const Inherited& inherited) {
    if (record.Has(420)) {
      has_colors_ = true;
      return TrueColor(static_cast<uint32_t>(record.Integer(420)));
    }
    int index = std::abs(record.Integer(62, kByLayer));
    if (index == kByBlock) return inherited.color;
    if (index == kByLayer) {
      if (layer != nullptr && layer->true_color) {
        has_colors_ = true;
        return *layer->true_color;
      }
      index = layer != nullptr ? layer->color : kForeground;
    }
    has_colors_ |= index != kForeground;
    return IndexedColor(index);
  }

  void Insert(const DxfRecord& record, const NodeMatrix& map, const Inherited& inherited,
              int depth) {
    const auto block = drawing_.blocks.find(std::string(record.Text(2)));
    if (block == drawing_.blocks.end()) {
      ++missing_;
      return;
    }
    if (depth >= kMostBlockDepth) {
      status_ = FileError(
          file_, absl::StrCat("line ", record.line, " inserts a block within ", depth, " others"),
          absl::StrCat("at most ", kMostBlockDepth, " are read"));
      return;
    }
    const double angle = record.Number(50) * std::numbers::pi / 180;
    const double c = std::cos(angle), s = std::sin(angle);
    const Point3 scale = {record.Number(41, 1), record.Number(42, 1), record.Number(43, 1)};
    const Point3 at = record.Point(10), base = block->second.base;
    const int columns = std::max(1, record.Integer(70, 1)),
              rows = std::max(1, record.Integer(71, 1));
    const NodeMatrix outer = Compose(map, PlaneOf(record));
    for (int row = 0; row < rows && status_.ok(); ++row) {
      for (int column = 0; column < columns && status_.ok(); ++column) {
        if (++inserts_ > kMostInserts) {
          status_ =
              FileError(file_, absl::StrCat("inserts blocks more than ", kMostInserts, " times"),
                        "so large a drawing is not read");
          return;
        }
        const double dx = column * record.Number(44), dy = row * record.Number(45);
        const NodeMatrix place = {c * scale.x, -s * scale.y,
                                  0,           at.x + c * dx - s * dy,
                                  s * scale.x, c * scale.y,
                                  0,           at.y + s * dx + c * dy,
                                  0,           0,
                                  scale.z,     at.z};
        const NodeMatrix origin = {1, 0, 0, -base.x, 0, 1, 0, -base.y, 0, 0, 1, -base.z};
        Add(block->second.entities, Compose(outer, Compose(place, origin)), inherited, depth + 1);
      }
    }
  }

  void Draw(const DxfEntity& entity, const NodeMatrix& map) {
    const DxfRecord& record = entity.record;
    const absl::string_view type = record.type;
    const NodeMatrix plane = Compose(map, PlaneOf(record));
    if (type != "3DFACE")
      AddLeftOut("thicknesses of entities", record.Number(39) != 0 ? 1 : 0, model_);
    if (type == "3DFACE") {
      Face({record.Point(10), record.Point(11), record.Point(12),
            record.Has(13) ? record.Point(13) : record.Point(12)},
           map);
    } else if (type == "SOLID" || type == "TRACE") {
      // The format stores the last two corners in reverse order.
      const Point3 third = record.Point(12);
      Face({record.Point(10), record.Point(11), record.Has(13) ? record.Point(13) : third, third},
           plane);
    } else if (type == "LINE" || type == "3DLINE") {
      Segment(record.Point(10), record.Point(11), map);
    } else if (type == "POINT") {
      Reserve(1);
      points_.positions.push_back(Checked(MapPoint(map, record.Point(10))));
      points_.colors.push_back(color_);
    } else if (type == "CIRCLE" || type == "ARC") {
      const double from = type == "ARC" ? record.Number(50) : 0;
      double to = type == "ARC" ? record.Number(51) : 360;
      while (to <= from && std::abs(to) < 1e6) to += 360;
      const Point3 center = record.Point(10);
      const double radius = record.Number(40);
      Curve(from * std::numbers::pi / 180, to * std::numbers::pi / 180, [&](double t) {
        return MapPoint(
            plane, {center.x + radius * std::cos(t), center.y + radius * std::sin(t), center.z});
      });
    } else if (type == "ELLIPSE") {
      const Point3 center = record.Point(10), major = record.Point(11);
      const Point3 z = Direction(
          {record.Number(210), record.Number(220), record.Number(230, record.Has(210) ? 0 : 1)});
      const double ratio = record.Number(40, 1);
      const Point3 minor = {ratio * (z.y * major.z - z.z * major.y),
                            ratio * (z.z * major.x - z.x * major.z),
                            ratio * (z.x * major.y - z.y * major.x)};
      const double from = record.Number(41);
      double to = record.Number(42, 2 * std::numbers::pi);
      while (to <= from && std::abs(to) < 1e6) to += 2 * std::numbers::pi;
      Curve(from, to, [&](double t) {
        const double c = std::cos(t), s = std::sin(t);
        return MapPoint(map,
                        {center.x + c * major.x + s * minor.x, center.y + c * major.y + s * minor.y,
                         center.z + c * major.z + s * minor.z});
      });
    } else if (type == "LWPOLYLINE") {
      LightPolyline(record, plane);
    } else if (type == "POLYLINE") {
      Polyline(entity, map, plane);
    } else {
      const std::string name(
          unread_.size() < kMostTypes || unread_.contains(std::string(type)) ? type : "not listed");
      ++unread_[name];
    }
  }

  // A corner of a planar polyline. `bulge` is the tangent of a quarter of the angle of the arc to the
  // next corner; 0 for a straight segment.
  struct Bulged {
    Point3 at;
    double bulge = 0;
  };

  void Bulge(const Bulged& from, const Point3& to, const NodeMatrix& plane) {
    if (std::abs(from.bulge) < 1e-9) return Segment(from.at, to, plane);
    const double dx = to.x - from.at.x, dy = to.y - from.at.y, b = from.bulge;
    // The distance from the middle of the chord to the centre, by the chord's length, to its left.
    const double off = (1 - b * b) / (4 * b);
    const Point3 center = {(from.at.x + to.x) / 2 - dy * off, (from.at.y + to.y) / 2 + dx * off,
                           from.at.z};
    const double begin = std::atan2(from.at.y - center.y, from.at.x - center.x);
    const double radius = std::hypot(from.at.x - center.x, from.at.y - center.y);
    Curve(begin, begin + 4 * std::atan(b), [&](double t) {
      return MapPoint(
          plane, {center.x + radius * std::cos(t), center.y + radius * std::sin(t), from.at.z});
    });
  }

  void Chain(const std::vector<Bulged>& corners, bool closed, const NodeMatrix& plane) {
    for (size_t i = 1; i < corners.size(); ++i) Bulge(corners[i - 1], corners[i].at, plane);
    if (closed && corners.size() > 1) Bulge(corners.back(), corners.front().at, plane);
  }

  void CountWidth(const DxfRecord& record) {
    const bool has_width =
        record.Number(40) != 0 || record.Number(41) != 0 || record.Number(43) != 0;
    AddLeftOut("widths of polylines", has_width ? 1 : 0, model_);
  }

  void LightPolyline(const DxfRecord& record, const NodeMatrix& plane) {
    std::vector<Bulged> corners;
    CountWidth(record);
    const double z = record.Number(38);
    for (const DxfPair& pair : record.pairs) {
      double number = 0;
      if (!absl::SimpleAtod(pair.value, &number)) continue;
      if (pair.code == 10) {
        corners.push_back({{number, 0, z}, 0});
      } else if (!corners.empty() && pair.code == 20) {
        corners.back().at.y = number;
      } else if (!corners.empty() && pair.code == 42) {
        corners.back().bulge = number;
      }
    }
    Chain(corners, (record.Integer(70) & 1) != 0, plane);
  }

  void Polyline(const DxfEntity& entity, const NodeMatrix& map, const NodeMatrix& plane) {
    const DxfRecord& record = entity.record;
    const int flags = record.Integer(70);
    const bool is_mesh = (flags & 16) != 0, is_faces = (flags & 64) != 0, is_3d = (flags & 8) != 0;
    CountWidth(record);
    std::vector<Bulged> corners;
    std::vector<const DxfRecord*> faces;
    for (const DxfRecord& vertex : entity.vertices) {
      const int kind = vertex.Integer(70);
      if ((kind & 128) != 0 && (kind & 64) == 0) {
        faces.push_back(&vertex);
      } else if ((kind & 16) ==
                 0) {  // that is a control point of a spline, which its own points follow
        Point3 at = vertex.Point(10);
        if (!is_mesh && !is_faces && !is_3d) at.z = record.Number(30);
        corners.push_back({at, vertex.Number(42)});
      }
    }
    if (is_faces) return Faces(corners, faces, map);
    if (is_mesh) return Mesh(record, flags, corners, map);
    if (is_3d) {
      for (Bulged& corner : corners) corner.bulge = 0;
    }
    Chain(corners, (flags & 1) != 0, is_3d ? map : plane);
  }

  void Faces(const std::vector<Bulged>& corners, const std::vector<const DxfRecord*>& faces,
             const NodeMatrix& map) {
    for (const DxfRecord* face : faces) {
      std::vector<Point3> used;
      for (const int code : {71, 72, 73, 74}) {
        // A negative number means that the edge that begins there is hidden.
        const int64_t number = std::abs(int64_t{face->Integer(code)});
        if (number == 0) continue;
        if (static_cast<size_t>(number) > corners.size()) {
          status_ = FileError(
              file_, absl::StrCat("the face in line ", face->line, " refers to vertex ", number),
              absl::StrCat("its polyline has ", corners.size()));
          return;
        }
        used.push_back(corners[static_cast<size_t>(number) - 1].at);
      }
      if (used.size() == 2) Segment(used[0], used[1], map);
      if (used.size() >= 3) Face({used[0], used[1], used[2], used.back()}, map);
    }
  }

  // Adds a grid of M by N vertices, which may be closed in both directions.
  void Mesh(const DxfRecord& record, int flags, const std::vector<Bulged>& corners,
            const NodeMatrix& map) {
    // A smoothed mesh has the density of the smooth surface.
    const bool smooth = record.Integer(75) != 0;
    const auto m = static_cast<size_t>(std::max(0, record.Integer(smooth ? 73 : 71)));
    const auto n = static_cast<size_t>(std::max(0, record.Integer(smooth ? 74 : 72)));
    if (m == 0 || n == 0 || corners.size() / m != n || corners.size() % m != 0) {
      status_ = FileError(
          file_,
          absl::StrCat("the mesh in line ", record.line, " has ", corners.size(), " vertices"),
          absl::StrCat(m, " by ", n, " are announced"));
      return;
    }
    const size_t rows = (flags & 1) != 0 ? m : m - 1, columns = (flags & 32) != 0 ? n : n - 1;
    const auto at = [&](size_t i, size_t j) { return corners[i % m * n + j % n].at; };
    for (size_t i = 0; i < rows; ++i) {
      for (size_t j = 0; j < columns; ++j)
        Face({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)}, map);
    }
  }

  template <typename PointAt>
  void Curve(double from, double to, PointAt point_at) {
    const double share = std::abs(to - from) / (2 * std::numbers::pi);
    const int steps =
        std::clamp(static_cast<int>(std::ceil(std::min(share, 1e3) * kArcSteps)), 1, 1000);
    Point3 last = point_at(from);
    for (int i = 1; i <= steps; ++i) {
      const Point3 next = point_at(from + (to - from) * i / steps);
      Segment(last, next, kIdentity);
      last = next;
    }
  }

  void Segment(const Point3& from, const Point3& to, const NodeMatrix& map) {
    Reserve(2);
    for (const Point3& end : {from, to}) {
      lines_.indices.push_back(static_cast<uint32_t>(lines_.positions.size()));
      lines_.positions.push_back(Checked(MapPoint(map, end)));
      lines_.colors.push_back(color_);
    }
  }

  // Adds a quad, or a triangle if the last corner equals the third or the first one.
  void Face(std::array<Point3, 4> corners, const NodeMatrix& map) {
    for (Point3& corner : corners) corner = Checked(MapPoint(map, corner));
    for (const auto& [a, b, c] : {std::array{0, 1, 2}, {0, 2, 3}}) {
      if (c == 3 && (corners[3] == corners[2] || corners[3] == corners[0])) continue;
      for (const int i : {a, b, c}) {
        if (!surface_.Add({corners[i], {}, color_})) Reserve(kMaxModelVertices);
      }
    }
  }

  void Reserve(uint64_t more) {
    vertices_ += more;
    if (vertices_ <= kMaxModelVertices || !status_.ok()) return;
    status_ = FileError(file_, absl::StrCat("has over ", kMaxModelVertices, " vertices"),
                        "so large a model is not read");
  }

  Point3 Checked(const Point3& p) {
    if (!(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)) && status_.ok())
      status_ = FileError(file_, absl::StrCat("has a vertex at (", p.x, ", ", p.y, ", ", p.z, ")"),
                          "coordinates must be finite");
    return p;
  }

  const SourceFile& file_;
  const DxfDrawing& drawing_;
  Model* const model_;
  absl::Status status_;
  Rgb color_;  // of the entity that is drawn
  bool has_colors_ = false;
  SurfaceBuilder surface_{true};
  Part lines_, points_;
  uint64_t vertices_ = 0, inserts_ = 0, hidden_ = 0, paper_ = 0, missing_ = 0;
  std::map<std::string, uint64_t> unread_;  // by type
};

}  // namespace

absl::StatusOr<Model> ReadDxfModel(const SourceFile& file) {
  if (absl::StartsWith(file.bytes, "AutoCAD Binary DXF"))
    return FileError(file, "is a binary DXF", "save it as ASCII DXF");
  if (file.bytes.size() > kMostDxfBytes) {
    return FileError(file, absl::StrCat("has ", file.bytes.size(), " bytes"),
                     absl::StrCat("DXF of at most ", kMostDxfBytes, " are read"));
  }
  if (file.bytes.find('\0') != std::string::npos)
    return FileError(file, absl::StrCat("is ", DescribeContents(file.bytes)),
                     "ASCII DXF is expected");
  const absl::StatusOr<DxfDrawing> drawing = DxfParser(file).Parse();
  if (!drawing.ok()) return drawing.status();
  Model model;
  model.path = file.path;
  model.format = "DXF";
  model.up = Up::kZ;
  model.unit = drawing->unit;
  if (!drawing->has_end) AddNote("it ends without EOF, so some of it may be missing", &model);
  if (absl::Status status = DxfBuilder(file, *drawing, &model).Build(); !status.ok()) return status;
  return model;
}

}  // namespace voxeld::voxelctl
