// Maps: GeoJSON (RFC 7946) and TopoJSON (its specification, version 1).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/map_lines.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

inline constexpr std::string_view kNoCoordinates = "geometries without coordinates";

// Reads properties: the colours of simplestyle 1.1 (stroke, or else fill, and marker-color with their opacities) and all numbers. Counts
// in `lines` what of a style is not drawn. Nothing if `properties` is null or not an object.
MapFeature FeatureOf(const nlohmann::json* properties, MapLines* lines);

// Any GeoJSON object: lines and the rings of polygons become lines, points become points; a third coordinate is a height. InvalidArgument names the member that is wrong.
absl::StatusOr<Model> ReadGeoJson(const SourceFile& file, const nlohmann::json& document,
                                  bool globe, bool attributes = false);

// A Topology. Arcs are decoded (deltas and transform, if it has one) and each that an object refers
// to is drawn once, however many neighbours share it; so every polygon's rings are closed and no
// border is doubled; it has the colour and the numbers of the first.
absl::StatusOr<Model> ReadTopoJson(const SourceFile& file, const nlohmann::json& document,
                                   bool globe, bool attributes = false);

}  // namespace voxeld::voxelctl
