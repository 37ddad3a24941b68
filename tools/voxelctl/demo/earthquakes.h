// Earthquakes as listed by the United States Geological Survey, each at its place inside the Earth.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

struct Earthquake {
  double longitude = 0, latitude = 0;  // degrees
  double depth_km = 0;                 // below sea level
  double magnitude = 0;
};

// Reads GeoJSON whose points have the depth in kilometres as their third coordinate, and a property
// "mag". Earthquakes without a magnitude are left out. Errors: InvalidArgument with the first
// invalid one.
absl::StatusOr<std::vector<Earthquake>> ReadEarthquakes(const SourceFile& file);

// Returns the position in Earth radii (6371 km), oriented like MapLines' globe: poles on ±z,
// longitude 0 in front (−y), east to the right.
Point3 Hypocentre(const Earthquake& quake);

// Returns the colour for a depth: yellow at the surface, red where slabs descend (100 km), violet
// and blue deepest (650 km).
Rgb DepthColor(double depth_km);

// Returns balls, thicker for stronger earthquakes, on the globe that MapLines makes.
Model EarthquakeModel(const std::vector<Earthquake>& quakes);

}  // namespace voxeld::voxelctl
