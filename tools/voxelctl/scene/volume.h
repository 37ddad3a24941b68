// Converts a placed volume to the client's shapes.
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
  std::string colormap;                         // empty: grey, or a single colour for an isosurface
  std::optional<std::array<double, 2>> window;  // from nothing to the brightest; ascending
  std::optional<double> level;                  // shows the surface at this level instead
};

// Bytes of a message that are reserved for everything except its bulk data.
inline constexpr uint64_t kMessageOverhead = 4096;

// Sends bytes to the server as an asset.
using AssetSink = std::function<absl::StatusOr<client::Asset>(absl::string_view bytes)>;

struct PackedVolume {
  client::Part part;
  uint64_t bytes = 0;    // approximate, on the wire
  uint64_t samples = 0;  // number sent
  std::string note;      // information for people; usually empty
};

// Returns the volume's own window. Without one, it begins at the threshold of Otsu's method and
// ends where only one in a thousand values is greater.
std::array<double, 2> WindowOf(const SampledVolume& volume);

// Converts a volume. Colours are shown as they are, unless `look` sets something else for their
// brightness. Numbers go through a transfer function, from nothing at the window's low end to the
// last colour of the colour map at its high end; the window is the one in `look`, or otherwise
// WindowOf. Samples are sent as one byte each within the window, or for an isosurface as two bytes
// between the least and the greatest. Data too large for one message are sent as an asset, if there
// is an `upload` and the server accepts assets. If they still exceed `limits`, they are averaged
// over cells of whole numbers of samples. That is noted, and so is an asset for which the server
// has no space. Errors: InvalidArgument if the level is beyond all samples; the upload's own
// errors.
absl::StatusOr<PackedVolume> PackVolume(const SampledVolume& volume, const VolumeLook& look,
                                        const client::Limits& limits, const AssetSink& upload = {});

}  // namespace voxeld::voxelctl
