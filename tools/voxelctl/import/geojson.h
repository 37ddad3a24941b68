// Reads maps: GeoJSON (RFC 7946) and TopoJSON (its specification, version 1).
//
// GDAL also reads both formats, but these readers are our own, because voxelctl shows maps without
// the optional package voxeld-import: the demonstration shows a globe from TopoJSON. JSON needs
// only nlohmann-json, which voxelctl uses anyway, while GDAL needs 81 further packages (174 MiB).
// GDAL would also draw an arc of TopoJSON once for each neighbour that shares it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string_view>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/map_lines.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

inline constexpr std::string_view kNoCoordinates = "geometries without coordinates";

// Reads a position: two numbers, and a height if the third is one. Counts the numbers after it in
// `lines`. Returns nothing if `value` is not a position.
std::optional<LonLat> PositionOf(const nlohmann::json& value, MapLines* lines);

// Reads properties: the colours of simplestyle 1.1 (stroke, or otherwise fill, and marker-color
// with their opacities) and all numbers. Counts in `lines` the parts of a style that are not drawn.
// Returns an empty feature if `properties` is null or not an object.
MapFeature FeatureOf(const nlohmann::json* properties, MapLines* lines);

// Reads any GeoJSON object. Lines and rings of polygons become lines, and points become points; a
// third coordinate is a height. Errors: InvalidArgument with the invalid member.
absl::StatusOr<Model> ReadGeoJson(const SourceFile& file, const nlohmann::json& document,
                                  bool globe, bool attributes = false);

// Reads a Topology. Arcs are decoded (deltas and, if present, the transform), and each arc that an
// object refers to is drawn once, however many neighbours share it. So the rings of all polygons
// are closed and no border is doubled; a shared arc has the colour and the numbers of the first
// object. Geometries have the properties of the collection around them, unless they have the same
// ones themselves. Heights are neither deltas nor transformed.
absl::StatusOr<Model> ReadTopoJson(const SourceFile& file, const nlohmann::json& document,
                                   bool globe, bool attributes = false);

}  // namespace voxeld::voxelctl
