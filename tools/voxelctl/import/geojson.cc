#include "tools/voxelctl/import/geojson.h"

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/map_lines.h"

namespace voxeld::voxelctl {
namespace {

using nlohmann::json;

// Depth of what it walks is bounded by ParseJson.
class GeoJsonReader {
 public:
  GeoJsonReader(const SourceFile& file, bool globe) : file_(file), lines_(file, globe) {}

  absl::Status ReadObject(const json& object, const std::string& where);
  absl::Status Finish(Model* model) && {
    AddLeftOut("geometries without coordinates", nowhere_, model);
    return std::move(lines_).Finish("GeoJSON", model);
  }

 private:
  absl::Status Wrong(const std::string& where, absl::string_view expected) const {
    return FileError(file_, absl::StrCat(where, " is not as GeoJSON wants it"),
                     absl::StrCat(expected, " is expected"));
  }
  absl::Status ReadMembers(const json& object, const char* key, const std::string& where);
  absl::Status ReadPosition(const json& position, const std::string& where, LonLat* out) const;
  absl::Status ReadCoordinates(const json& coordinates, const std::string& where, int depth,
                               bool closed, bool points);

  const SourceFile& file_;
  MapLines lines_;
  uint64_t nowhere_ = 0;  // geometries that are null or empty
};

absl::Status GeoJsonReader::ReadPosition(const json& position, const std::string& where,
                                         LonLat* out) const {
  if (!position.is_array() || position.size() < 2 || !position[0].is_number() ||
      !position[1].is_number()) {
    return Wrong(where, "a position [longitude, latitude]");
  }
  *out = {position[0].get<double>(), position[1].get<double>()};
  return absl::OkStatus();
}

// depth 0: one position; 1: a line of positions; more: arrays of such.
absl::Status GeoJsonReader::ReadCoordinates(const json& coordinates, const std::string& where,
                                            int depth, bool closed, bool points) {
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
    if (!geometry->is_null()) return ReadObject(*geometry, absl::StrCat(where, ".geometry"));
    ++nowhere_;
    return absl::OkStatus();
  }
  for (const Shape& shape : kShapes) {
    if (type != shape.type) continue;
    const auto coordinates = object.find("coordinates");
    const std::string at = absl::StrCat(where, ".coordinates");
    if (coordinates == object.end()) return Wrong(at, "an array");
    // RFC 7946, 3.1: an empty array means the same as null.
    if (coordinates->is_array() && coordinates->empty()) {
      ++nowhere_;
      return absl::OkStatus();
    }
    return ReadCoordinates(*coordinates, at, shape.depth, shape.closed, shape.points);
  }
  return FileError(
      file_, absl::StrCat(where, ".type is \"", EscapeForTerminal(type.substr(0, 40)), "\""),
      "a GeoJSON type is expected, such as FeatureCollection, Feature, LineString or Polygon");
}

}  // namespace

absl::StatusOr<Model> ReadGeoJson(const SourceFile& file, const json& document, bool globe) {
  GeoJsonReader reader(file, globe);
  absl::Status status = reader.ReadObject(document, "document");
  if (!status.ok()) return status;
  Model model;
  status = std::move(reader).Finish(&model);
  if (!status.ok()) return status;
  return model;
}

}  // namespace voxeld::voxelctl
