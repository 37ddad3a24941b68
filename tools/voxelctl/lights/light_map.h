// Maps numbered lights to places in the display.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "voxeld/drawing.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// The maximum number of lights.
inline constexpr size_t kMostLights = size_t{1} << 18;

struct LightMap {
  size_t lights = 0;            // numbers: 0 to lights - 1
  std::vector<uint32_t> light;  // per place: its light's number, below `lights`
  std::vector<float> places;    // x y z per place, in the display's voxels
  bool cells = false;           // places are corners of cells one unit wide; otherwise points
  client::Affine transform;     // places → scene
  std::string where;            // description for people

  // Returns the places in the colours of `values`, three per light.
  client::Points Picture(std::span<const uint8_t> values) const;
};

// Returns a display's own lights, numbered by its pixels, slice after slice. Errors:
// FailedPrecondition if it is not a lattice.
absl::StatusOr<LightMap> LightsOf(const v1::DisplayDescription& display);

// Returns a box of lights, x fastest, then y, then z, centred in the display's volume and as large
// as fits. If the volume has as many voxels along each axis, each light is one voxel. A light that
// spans several voxels fills them.
absl::StatusOr<LightMap> LightsInBox(std::array<int, 3> size,
                                     const v1::DisplayDescription& display);

// Returns lights at the points of an Open Pixel Control layout, centred in the display's volume and
// as large as fits; each is one voxel. Errors: InvalidArgument with the invalid entry.
absl::StatusOr<LightMap> LightsOfLayout(std::string_view json,
                                        const v1::DisplayDescription& display);

}  // namespace voxeld::voxelctl
