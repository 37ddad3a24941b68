// Earthquakes as the United States Geological Survey lists them, each where it was inside the Earth.
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

// Of GeoJSON whose points have a third coordinate, the depth in kilometres, and a property "mag". Those without a magnitude
// are left out. InvalidArgument names the first that is wrong.
absl::StatusOr<std::vector<Earthquake>> ReadEarthquakes(const SourceFile& file);

// In Earth radii (6371 km), as MapLines has a globe: poles on ±z, longitude 0 in front (−y), east to the right.
Point3 Hypocentre(const Earthquake& quake);

// By depth: yellow at the surface, red where slabs go down (100 km), violet and blue deepest (650 km).
Rgb DepthColor(double depth_km);

// Balls, the thicker the stronger, on the globe that MapLines makes.
Model EarthquakeModel(const std::vector<Earthquake>& quakes);

}  // namespace voxeld::voxelctl
