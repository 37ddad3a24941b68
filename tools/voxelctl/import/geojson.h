// Maps: GeoJSON (RFC 7946) and TopoJSON (its specification, version 1).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Any GeoJSON object: lines and the rings of polygons become lines, points become points; a third
// coordinate is not used. InvalidArgument names the member that is wrong.
absl::StatusOr<Model> ReadGeoJson(const SourceFile& file, const nlohmann::json& document,
                                  bool globe);

// A Topology. Arcs are decoded (deltas and transform, if it has one) and each that an object refers
// to is drawn once, however many neighbours share it; so every polygon's rings are closed and no
// border is doubled.
absl::StatusOr<Model> ReadTopoJson(const SourceFile& file, const nlohmann::json& document,
                                   bool globe);

}  // namespace voxeld::voxelctl
