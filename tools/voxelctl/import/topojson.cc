#include <array>
#include <nlohmann/json.hpp>
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
  absl::Status Wrong(const std::string& where, absl::string_view expected) const {
    return FileError(file_, absl::StrCat(where, " is not as TopoJSON wants it"),
                     absl::StrCat(expected, " is expected"));
  }
  absl::Status ReadPair(const json& value, const std::string& where,
                        std::array<double, 2>* out) const;
  absl::Status ReadTransform(const json& document);
  absl::Status MarkArcs(const json& arcs, const std::string& where, uint32_t feature);
  absl::Status ReadPoints(const json& coordinates, const std::string& where);
  absl::Status ReadGeometry(const json& geometry, const std::string& where);
  absl::Status DrawArc(const json& arc, const std::string& where);

  LonLat Place(double x, double y) const {
    return {x * scale_[0] + translate_[0], y * scale_[1] + translate_[1]};
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
  std::array<double, 2> position{};
  absl::Status status = ReadPair(coordinates, where, &position);
  if (!status.ok()) return status;
  return lines_.AddPoint(Place(position[0], position[1]));
}

absl::Status TopoJsonReader::ReadGeometry(const json& geometry, const std::string& where) {
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
  if (*type == "GeometryCollection") {
    const json* geometries = member("geometries");
    if (geometries == nullptr || !geometries->is_array())
      return Wrong(absl::StrCat(where, ".geometries"), "an array");
    for (size_t i = 0; i < geometries->size(); ++i) {
      absl::Status status =
          ReadGeometry((*geometries)[i], absl::StrCat(where, ".geometries[", i, "]"));
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }
  const uint32_t feature = lines_.BeginFeature(FeatureOf(member("properties"), &lines_));
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
  std::array<double, 2> at{};
  for (size_t i = 0; i < line.size(); ++i) {
    std::array<double, 2> value{};
    absl::Status status = ReadPair(arc[i], absl::StrCat(where, "[", i, "]"), &value);
    if (!status.ok()) return status;
    at = quantized_ ? std::array<double, 2>{at[0] + value[0], at[1] + value[1]} : value;
    line[i] = Place(at[0], at[1]);
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
    status = ReadGeometry(geometry, absl::StrCat("objects.", EscapeForTerminal(name)));
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
