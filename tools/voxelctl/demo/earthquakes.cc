#include "tools/voxelctl/demo/earthquakes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/import/json_text.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kEarthKm = 6371;

struct ColorStop {
  double depth_km;
  Rgb color;
};

constexpr std::array<ColorStop, 5> kDepthColors = {{{0, {255, 230, 70}},
                                                    {35, {255, 140, 30}},
                                                    {100, {255, 45, 45}},
                                                    {300, {210, 60, 255}},
                                                    {650, {70, 110, 255}}}};

// The thickness in Earth radii from a magnitude on.
struct Size {
  double magnitude, thickness;
};
constexpr std::array<Size, 4> kSizes = {{{-HUGE_VAL, 0}, {2.5, 0.022}, {4.5, 0.036}, {5.5, 0.06}}};

uint8_t Mixed(uint8_t a, uint8_t b, double share) {
  return static_cast<uint8_t>(std::lround(a + (b - a) * share));
}

}  // namespace

absl::StatusOr<std::vector<Earthquake>> ReadEarthquakes(const SourceFile& file) {
  const absl::StatusOr<nlohmann::json> parsed = ParseJson(file, file.bytes);
  if (!parsed.ok()) return parsed.status();
  const auto features = parsed->find("features");
  if (!parsed->is_object() || features == parsed->end() || !features->is_array()) {
    return FileError(file, "there is no list \"features\"",
                     "GeoJSON's FeatureCollection of earthquakes is expected");
  }
  std::vector<Earthquake> quakes;
  for (size_t i = 0; i < features->size(); ++i) {
    const nlohmann::json& feature = (*features)[i];
    const nlohmann::json none;
    const auto member = [&](const nlohmann::json& object, const char* key) -> const auto& {
      if (!object.is_object()) return none;
      const auto found = object.find(key);
      return found == object.end() ? none : *found;
    };
    const nlohmann::json& magnitude = member(member(feature, "properties"), "mag");
    if (magnitude.is_null()) continue;
    const nlohmann::json& place = member(member(feature, "geometry"), "coordinates");
    const auto is_number = [](const nlohmann::json& v) { return v.is_number(); };
    if (!magnitude.is_number() || !place.is_array() || place.size() != 3 ||
        !std::all_of(place.begin(), place.end(), is_number)) {
      return FileError(file, absl::StrCat("features[", i, "] is no earthquake"),
                       "coordinates [longitude, latitude, depth in km] and a number \"mag\" are "
                       "expected");
    }
    const Earthquake quake = {place[0].get<double>(), place[1].get<double>(),
                              place[2].get<double>(), magnitude.get<double>()};
    if (std::abs(quake.longitude) > 180 || std::abs(quake.latitude) > 90 ||
        quake.depth_km < -kEarthKm || quake.depth_km > kEarthKm) {
      return FileError(file,
                       absl::StrCat("features[", i, "] lies at ", quake.longitude, ", ",
                                    quake.latitude, ", ", quake.depth_km, " km"),
                       "longitudes to 180, latitudes to 90 and depths to 6371 km are expected");
    }
    quakes.push_back(quake);
  }
  if (quakes.empty()) {
    return FileError(file, "it has no earthquake with a magnitude", "at least one is expected");
  }
  return quakes;
}

Point3 Hypocentre(const Earthquake& quake) {
  const double lon = quake.longitude * std::numbers::pi / 180;
  const double lat = quake.latitude * std::numbers::pi / 180;
  const double r = 1 - quake.depth_km / kEarthKm;
  return {r * std::cos(lat) * std::sin(lon), -r * std::cos(lat) * std::cos(lon), r * std::sin(lat)};
}

Rgb DepthColor(double depth_km) {
  if (depth_km <= kDepthColors.front().depth_km) return kDepthColors.front().color;
  for (size_t i = 1; i < kDepthColors.size(); ++i) {
    const ColorStop &a = kDepthColors[i - 1], &b = kDepthColors[i];
    if (depth_km > b.depth_km) continue;
    const double share = (depth_km - a.depth_km) / (b.depth_km - a.depth_km);
    return {Mixed(a.color.r, b.color.r, share), Mixed(a.color.g, b.color.g, share),
            Mixed(a.color.b, b.color.b, share)};
  }
  return kDepthColors.back().color;
}

Model EarthquakeModel(const std::vector<Earthquake>& quakes) {
  Model model;
  model.format = "earthquakes";
  model.globe = model.lit_already = true;
  for (size_t size = 0; size < kSizes.size(); ++size) {
    Part part;
    part.kind = Kind::kPoints;
    part.thickness = kSizes[size].thickness;
    const double below = size + 1 < kSizes.size() ? kSizes[size + 1].magnitude : HUGE_VAL;
    for (const Earthquake& quake : quakes) {
      if (quake.magnitude < kSizes[size].magnitude || quake.magnitude >= below) continue;
      part.positions.push_back(Hypocentre(quake));
      part.colors.push_back(DepthColor(quake.depth_km));
    }
    if (!part.positions.empty()) model.parts.push_back(std::move(part));
  }
  return model;
}

}  // namespace voxeld::voxelctl
