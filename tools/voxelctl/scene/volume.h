// From a placed volume to the client's shapes.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "voxeld/client.h"

namespace voxeld::voxelctl {

struct VolumeLook {
  std::string colormap;  // empty: grey, or of an isosurface one colour
  std::optional<std::array<double, 2>>
      window;                   // from nothing to the brightest, first less than second
  std::optional<double> level;  // the surface there instead
};

// Bytes of a message that are reserved for everything but its bulk data.
inline constexpr uint64_t kMessageOverhead = 4096;

// Brings bytes to the server as an asset.
using AssetSink = std::function<absl::StatusOr<client::Asset>(absl::string_view bytes)>;

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
// one message has no room for goes as an asset, if there is an `upload` and the server takes assets; what `limits` have no room for
// then is averaged over cells of whole numbers of samples, and said, as is an asset that the server has no room for.
// InvalidArgument if the level lies beyond all samples; the upload's own errors.
absl::StatusOr<PackedVolume> PackVolume(const SampledVolume& volume, const VolumeLook& look,
                                        const client::Limits& limits, const AssetSink& upload = {});

}  // namespace voxeld::voxelctl
