#include "tools/voxelctl/import/geojson.h"

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/color_names.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/map_lines.h"

namespace voxeld::voxelctl {
namespace {

using nlohmann::json;

// ParseJson limits the depth of the recursion.
class GeoJsonReader {
 public:
  GeoJsonReader(const SourceFile& file, bool globe, bool attributes)
      : file_(file), lines_(file, globe, attributes) {}

  absl::Status ReadObject(const json& object, const std::string& where);
  absl::Status Finish(Model* model) && { return std::move(lines_).Finish("GeoJSON", model); }

 private:
  absl::Status Wrong(const std::string& where, absl::string_view expected) const {
    return FileError(file_, absl::StrCat(where, " is not as GeoJSON wants it"),
                     absl::StrCat(expected, " is expected"));
  }
  absl::Status ReadMembers(const json& object, const char* key, const std::string& where);
  absl::Status ReadPosition(const json& position, const std::string& where, LonLat* out);
  absl::Status ReadCoordinates(const json& coordinates, const std::string& where, int depth,
                               bool closed, bool points);

  const SourceFile& file_;
  MapLines lines_;
};

absl::Status GeoJsonReader::ReadPosition(const json& position, const std::string& where,
                                         LonLat* out) {
  const std::optional<LonLat> found = PositionOf(position, &lines_);
  if (!found) return Wrong(where, "a position [longitude, latitude]");
  *out = *found;
  return absl::OkStatus();
}

// `depth` 0 is one position; 1 is a line of positions; greater depths are arrays of such.
absl::Status GeoJsonReader::ReadCoordinates(const json& coordinates, const std::string& where,
                                            int depth, bool closed, bool points) {
  // RFC 7946, 3.1: an empty array means the same as null. Exporters write one for each empty part,
  // too.
  if (coordinates.is_array() && coordinates.empty()) {
    lines_.LeaveOut(kNoCoordinates);
    return absl::OkStatus();
  }
  if (depth == 0) {
    LonLat point;
    absl::Status status = ReadPosition(coordinates, where, &point);
    return status.ok() ? lines_.AddPoint(point) : status;
  }
  if (!coordinates.is_array()) return Wrong(where, "an array");
  if (depth > 1 || points) {
    for (size_t i = 0; i < coordinates.size(); ++i) {
      absl::Status status = ReadCoordinates(coordinates[i], absl::StrCat(where, "[", i, "]"),
                                            depth - 1, closed, points);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }
  std::vector<LonLat> line(coordinates.size());
  for (size_t i = 0; i < line.size(); ++i) {
    absl::Status status = ReadPosition(coordinates[i], absl::StrCat(where, "[", i, "]"), &line[i]);
    if (!status.ok()) return status;
  }
  return lines_.AddLine(line, closed);
}

absl::Status GeoJsonReader::ReadMembers(const json& object, const char* key,
                                        const std::string& where) {
  const auto it = object.find(key);
  if (it == object.end() || !it->is_array())
    return Wrong(absl::StrCat(where, ".", key), "an array");
  for (size_t i = 0; i < it->size(); ++i) {
    absl::Status status = ReadObject((*it)[i], absl::StrCat(where, ".", key, "[", i, "]"));
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status GeoJsonReader::ReadObject(const json& object, const std::string& where) {
  struct Shape {
    absl::string_view type;
    int depth;
    bool closed, points;
  };
  static constexpr Shape kShapes[] = {
      {"Point", 0, false, true},       {"MultiPoint", 1, false, true},
      {"LineString", 1, false, false}, {"MultiLineString", 2, false, false},
      {"Polygon", 2, true, false},     {"MultiPolygon", 3, true, false},
  };
  if (!object.is_object()) return Wrong(where, "an object");
  const auto type_item = object.find("type");
  if (type_item == object.end() || !type_item->is_string()) {
    return Wrong(absl::StrCat(where, ".type"), "the name of a GeoJSON type");
  }
  const std::string& type = type_item->get_ref<const std::string&>();
  if (type == "FeatureCollection") return ReadMembers(object, "features", where);
  if (type == "GeometryCollection") return ReadMembers(object, "geometries", where);
  if (type == "Feature") {
    const auto geometry = object.find("geometry");
    if (geometry == object.end())
      return Wrong(absl::StrCat(where, ".geometry"), "a geometry or null");
    const auto properties = object.find("properties");
    lines_.BeginFeature(FeatureOf(properties == object.end() ? nullptr : &*properties, &lines_));
    if (!geometry->is_null()) return ReadObject(*geometry, absl::StrCat(where, ".geometry"));
    lines_.LeaveOut(kNoCoordinates);
    return absl::OkStatus();
  }
  for (const Shape& shape : kShapes) {
    if (type != shape.type) continue;
    const auto coordinates = object.find("coordinates");
    const std::string at = absl::StrCat(where, ".coordinates");
    if (coordinates == object.end()) return Wrong(at, "an array");
    return ReadCoordinates(*coordinates, at, shape.depth, shape.closed, shape.points);
  }
  return FileError(
      file_, absl::StrCat(where, ".type is \"", EscapeForTerminal(type.substr(0, 40)), "\""),
      "a GeoJSON type is expected, such as FeatureCollection, Feature, LineString or Polygon");
}

}  // namespace

std::optional<LonLat> PositionOf(const json& value, MapLines* lines) {
  if (!value.is_array() || value.size() < 2 || !value[0].is_number() || !value[1].is_number())
    return std::nullopt;
  LonLat position{value[0].get<double>(), value[1].get<double>()};
  if (value.size() > 2 && value[2].is_number()) position.height = value[2].get<double>();
  if (value.size() > 3) lines->LeaveOut("further numbers of positions", value.size() - 3);
  return position;
}

MapFeature FeatureOf(const json* properties, MapLines* lines) {
  MapFeature feature;
  if (properties == nullptr || !properties->is_object()) return feature;
  const auto color = [&](const char* key, const char* opacity) -> std::optional<Rgb> {
    const auto found = properties->find(key);
    if (found == properties->end() || !found->is_string()) return std::nullopt;
    // simplestyle allows #rgb without the #.
    const std::string& text = found->get_ref<const std::string&>();
    std::optional<uint32_t> parsed = ParseColor(text);
    if (!parsed) parsed = ParseColor("#" + text);
    if (!parsed) {
      if (!text.empty()) lines->LeaveOut("colours that are not colours");
      return std::nullopt;
    }
    const Rgb rgb = {static_cast<uint8_t>(*parsed >> 16), static_cast<uint8_t>(*parsed >> 8),
                     static_cast<uint8_t>(*parsed)};
    const auto share = properties->find(opacity);
    return share != properties->end() && share->is_number() ? WithOpacity(rgb, share->get<double>())
                                                            : rgb;
  };
  const std::optional<Rgb> fill = color("fill", "fill-opacity");
  feature.line = color("stroke", "stroke-opacity");
  if (!feature.line) feature.line = fill;
  feature.point = color("marker-color", "marker-opacity");
  if (fill) lines->LeaveOut("fills of areas");
  const auto symbol = properties->find("marker-symbol");
  if (symbol != properties->end() && symbol->is_string() && *symbol != "")
    lines->LeaveOut(kPointSymbols);
  // All lines are equally wide, and all points equally large. The defaults of simplestyle are a
  // width of 2 and the size "medium".
  const auto differs = [&](const char* key, const json& initial) {
    const auto found = properties->find(key);
    return found != properties->end() && !found->is_null() && *found != "" && *found != initial;
  };
  if (differs("stroke-width", 2) && differs("stroke-width", "2")) lines->LeaveOut(kLineWidths);
  if (differs("marker-size", "medium")) lines->LeaveOut(kPointSizes);
  for (const auto& [name, value] : properties->items()) {
    if (value.is_number()) feature.numbers.emplace_back(name, value.get<double>());
  }
  return feature;
}

absl::StatusOr<Model> ReadGeoJson(const SourceFile& file, const json& document, bool globe,
                                  bool attributes) {
  GeoJsonReader reader(file, globe, attributes);
  absl::Status status = reader.ReadObject(document, "document");
  if (!status.ok()) return status;
  Model model;
  status = std::move(reader).Finish(&model);
  if (!status.ok()) return status;
  return model;
}

}  // namespace voxeld::voxelctl
