#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/geojson.h"
#include "tools/voxelctl/import/map_lines.h"

namespace voxeld::voxelctl {
namespace {

using nlohmann::json;

constexpr uint32_t kNobody = UINT32_MAX;

class TopoJsonReader {
 public:
  TopoJsonReader(const SourceFile& file, bool globe, bool attributes)
      : file_(file), lines_(file, globe, attributes) {}

  absl::StatusOr<Model> Read(const json& document);

 private:
  // The properties of the collections around a geometry, and the feature that those of its
  // geometries share that have no properties of their own.
  struct Inherited {
    json properties;
    std::optional<uint32_t> feature;
  };

  absl::Status Wrong(const std::string& where, absl::string_view expected) const {
    return FileError(file_, absl::StrCat(where, " is not as TopoJSON wants it"),
                     absl::StrCat(expected, " is expected"));
  }
  absl::Status ReadPair(const json& value, const std::string& where,
                        std::array<double, 2>* out) const;
  absl::Status ReadPosition(const json& value, const std::string& where, LonLat* out);
  absl::Status ReadTransform(const json& document);
  absl::Status MarkArcs(const json& arcs, const std::string& where, uint32_t feature);
  absl::Status ReadPoints(const json& coordinates, const std::string& where);
  absl::Status ReadGeometry(const json& geometry, const std::string& where, Inherited* inherited);
  absl::Status DrawArc(const json& arc, const std::string& where);

  LonLat Place(const LonLat& at) const {
    return {at.lon * scale_[0] + translate_[0], at.lat * scale_[1] + translate_[1], at.height};
  }

  const SourceFile& file_;
  MapLines lines_;
  bool quantized_ = false;  // has a transform, so arcs are deltas
  std::array<double, 2> scale_ = {1, 1}, translate_ = {0, 0};
  std::vector<uint32_t> users_;  // the first feature that refers to each arc, or kNobody
};

absl::Status TopoJsonReader::ReadPair(const json& value, const std::string& where,
                                      std::array<double, 2>* out) const {
  if (!value.is_array() || value.size() < 2 || !value[0].is_number() || !value[1].is_number()) {
    return Wrong(where, "an array of two numbers");
  }
  *out = {value[0].get<double>(), value[1].get<double>()};
  return absl::OkStatus();
}

absl::Status TopoJsonReader::ReadPosition(const json& value, const std::string& where,
                                          LonLat* out) {
  const std::optional<LonLat> found = PositionOf(value, &lines_);
  if (!found) return Wrong(where, "an array of two numbers");
  *out = *found;
  return absl::OkStatus();
}

absl::Status TopoJsonReader::ReadTransform(const json& document) {
  const auto transform = document.find("transform");
  if (transform == document.end()) return absl::OkStatus();
  quantized_ = true;
  if (!transform->is_object() || !transform->contains("scale") ||
      !transform->contains("translate")) {
    return Wrong("transform", "an object with scale and translate");
  }
  absl::Status status = ReadPair((*transform)["scale"], "transform.scale", &scale_);
  if (!status.ok()) return status;
  return ReadPair((*transform)["translate"], "transform.translate", &translate_);
}

// Arcs nest to any depth: a line's are numbers, a polygon's are arrays of them, and so on. ~i is
// arc i reversed.
absl::Status TopoJsonReader::MarkArcs(const json& arcs, const std::string& where,
                                      uint32_t feature) {
  if (arcs.is_array()) {
    if (arcs.empty()) lines_.LeaveOut(kNoCoordinates);
    for (const json& item : arcs) {
      absl::Status status = MarkArcs(item, where, feature);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }
  if (!arcs.is_number_integer()) return Wrong(where, "an array of arc numbers");
  const int64_t number = arcs.get<int64_t>();
  const int64_t index = number < 0 ? ~number : number;
  if (index < 0 || static_cast<uint64_t>(index) >= users_.size()) {
    return FileError(file_, absl::StrCat(where, " refers to arc ", number),
                     absl::StrCat("there are ", users_.size(), " arcs, counted from 0"));
  }
  uint32_t& user = users_[static_cast<size_t>(index)];
  if (user == kNobody) user = feature;
  return absl::OkStatus();
}

// Reads one position, or an array of them. Positions are never deltas.
absl::Status TopoJsonReader::ReadPoints(const json& coordinates, const std::string& where) {
  if (coordinates.is_array() && (coordinates.empty() || coordinates[0].is_array())) {
    if (coordinates.empty()) lines_.LeaveOut(kNoCoordinates);
    for (const json& item : coordinates) {
      absl::Status status = ReadPoints(item, where);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }
  LonLat position;
  absl::Status status = ReadPosition(coordinates, where, &position);
  return status.ok() ? lines_.AddPoint(Place(position)) : status;
}

absl::Status TopoJsonReader::ReadGeometry(const json& geometry, const std::string& where,
                                          Inherited* inherited) {
  if (!geometry.is_object()) return Wrong(where, "an object");
  const auto type = geometry.find("type");
  if (type == geometry.end() || type->is_null()) {
    lines_.LeaveOut(kNoCoordinates);
    return absl::OkStatus();
  }
  const auto member = [&](const char* key) -> const json* {
    const auto it = geometry.find(key);
    return it == geometry.end() ? nullptr : &*it;
  };
  const json* own = member("properties");
  Inherited joined;
  if (own != nullptr && own->is_object() && !own->empty()) {
    joined.properties = inherited->properties;
    joined.properties.update(*own);
    inherited = &joined;
  }
  if (*type == "GeometryCollection") {
    const json* geometries = member("geometries");
    if (geometries == nullptr || !geometries->is_array())
      return Wrong(absl::StrCat(where, ".geometries"), "an array");
    for (size_t i = 0; i < geometries->size(); ++i) {
      absl::Status status =
          ReadGeometry((*geometries)[i], absl::StrCat(where, ".geometries[", i, "]"), inherited);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }
  if (!inherited->feature)
    inherited->feature = lines_.BeginFeature(FeatureOf(&inherited->properties, &lines_));
  const uint32_t feature = *inherited->feature;
  lines_.ResumeFeature(feature);
  if (*type == "Point" || *type == "MultiPoint") {
    const json* coordinates = member("coordinates");
    const std::string at = absl::StrCat(where, ".coordinates");
    return coordinates == nullptr ? Wrong(at, "an array") : ReadPoints(*coordinates, at);
  }
  if (*type == "LineString" || *type == "MultiLineString" || *type == "Polygon" ||
      *type == "MultiPolygon") {
    const json* arcs = member("arcs");
    const std::string at = absl::StrCat(where, ".arcs");
    return arcs == nullptr || !arcs->is_array() ? Wrong(at, "an array")
                                                : MarkArcs(*arcs, at, feature);
  }
  return FileError(
      file_,
      absl::StrCat(where, ".type is ", EscapeForTerminal(type->dump(-1, ' ', true).substr(0, 40))),
      "a TopoJSON geometry is expected, such as Polygon or GeometryCollection");
}

absl::Status TopoJsonReader::DrawArc(const json& arc, const std::string& where) {
  if (!arc.is_array() || arc.empty()) return Wrong(where, "an array of positions");
  std::vector<LonLat> line(arc.size());
  LonLat before;
  for (size_t i = 0; i < line.size(); ++i) {
    LonLat at;
    absl::Status status = ReadPosition(arc[i], absl::StrCat(where, "[", i, "]"), &at);
    if (!status.ok()) return status;
    if (quantized_) at.lon += before.lon, at.lat += before.lat;
    line[i] = Place(at);
    before = at;
  }
  if (line.size() == 1) {  // simplification leaves such arcs
    lines_.LeaveOut("arcs of one position");
    return absl::OkStatus();
  }
  return lines_.AddLine(line, false);
}

absl::StatusOr<Model> TopoJsonReader::Read(const json& document) {
  const auto arcs = document.find("arcs");
  const auto objects = document.find("objects");
  if (arcs == document.end() || !arcs->is_array()) return Wrong("arcs", "an array");
  if (objects == document.end() || !objects->is_object()) return Wrong("objects", "an object");
  absl::Status status = ReadTransform(document);
  if (!status.ok()) return status;
  users_.assign(arcs->size(), kNobody);
  for (const auto& [name, geometry] : objects->items()) {
    Inherited none{json::object(), {}};
    status = ReadGeometry(geometry, absl::StrCat("objects.", EscapeForTerminal(name)), &none);
    if (!status.ok()) return status;
  }
  for (size_t i = 0; i < users_.size(); ++i) {
    if (users_[i] == kNobody) continue;
    lines_.ResumeFeature(users_[i]);
    status = DrawArc((*arcs)[i], absl::StrCat("arcs[", i, "]"));
    if (!status.ok()) return status;
  }
  Model model;
  status = std::move(lines_).Finish("TopoJSON", &model);
  if (!status.ok()) return status;
  return model;
}

}  // namespace

absl::StatusOr<Model> ReadTopoJson(const SourceFile& file, const json& document, bool globe,
                                   bool attributes) {
  return TopoJsonReader(file, globe, attributes).Read(document);
}

}  // namespace voxeld::voxelctl
