// From a placed volume to the client's shapes.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "voxeld/client.h"

namespace voxeld::voxelctl {

struct VolumeLook {
  std::string colormap;  // empty: grey, or of an isosurface one colour
  std::optional<std::array<double, 2>>
      window;                   // from nothing to the brightest, first less than second
  std::optional<double> level;  // the surface there instead
};

struct PackedVolume {
  client::Part part;
  uint64_t bytes = 0;    // about, on the wire
  uint64_t samples = 0;  // that are sent
  std::string note;      // what people should know of it; usually empty
};

// The volume's own window, else one from where Otsu's method parts its numbers in two to above all but one of a thousand.
std::array<double, 2> WindowOf(const SampledVolume& volume);

// Colours are shown as they are, unless `look` asks for something else of their brightness. Numbers go through a transfer function that goes from nothing at the window's low end to the colour map's last at its high end; the
// window is what `look` says, else WindowOf. Samples are sent in a byte each within the window, of an isosurface in two between the least and the greatest. What
// `limits` have no room for is averaged over cells of whole numbers of samples, and said.
// InvalidArgument if the level lies beyond all samples.
absl::StatusOr<PackedVolume> PackVolume(const SampledVolume& volume, const VolumeLook& look,
                                        const client::Limits& limits);

}  // namespace voxeld::voxelctl
