// Where the lights stand that come in by their numbers.
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

// Numbers of lights that can be told apart.
inline constexpr size_t kMostLights = size_t{1} << 18;

struct LightMap {
  size_t lights = 0;            // numbers: 0 to lights - 1
  std::vector<uint32_t> light;  // of each place: its light's number, below `lights`
  std::vector<float> places;    // x y z of each, in the display's voxels
  bool cells = false;           // each is the corner of a cell, one unit wide; else a point
  client::Affine transform;     // places → scene
  std::string where;            // for people

  // The places in the colours of `values`, three a light.
  client::Points Picture(std::span<const uint8_t> values) const;
};

// A display's own lights, by its pixels' numbers: slice after slice. FailedPrecondition if it is no lattice.
absl::StatusOr<LightMap> LightsOf(const v1::DisplayDescription& display);

// A box of lights, x fastest, then y, then z; as large as it can be in the display's volume, and in its middle. Where
// that has as many voxels along each axis, each light is one. A light that is several voxels large fills them.
absl::StatusOr<LightMap> LightsInBox(std::array<int, 3> size,
                                     const v1::DisplayDescription& display);

// Lights at the points of a layout of Open Pixel Control, as large as it can be in the display's volume, and in its
// middle; each is one voxel. InvalidArgument names the entry that is wrong.
absl::StatusOr<LightMap> LightsOfLayout(std::string_view json,
                                        const v1::DisplayDescription& display);

}  // namespace voxeld::voxelctl
