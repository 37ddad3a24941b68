// Converts the capabilities of a voxlink device (docs/protocols/voxlink.md §4.1, §4.2) to and from
// a display's geometry.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/drivers/voxlink/protocol.h"

namespace voxeld::display::voxlink {

struct DeviceCapabilities {
  Capabilities fixed{};
  Geometry geometry;  // the shape; the host chooses the grid, which stays empty
};

// Returns the block that GET_CAPABILITIES sends, page after page; `fixed.total_length`, `slices`,
// `width` and `height` are set from the geometry.
std::vector<std::byte> EncodeCapabilities(const DeviceCapabilities& capabilities);

// Parses the block of an untrusted device: every field is checked. Errors: DataLoss with the field
// and its value.
absl::StatusOr<DeviceCapabilities> ParseCapabilities(std::span<const std::byte> block);

// Errors: FailedPrecondition, with what was requested and what the device has, if it cannot show
// `layout` on `geometry` (grids and corrections are not compared). `calibrated`: the geometry was
// measured on the display, so that the device's mirrors, axes, tilts, phases and directions are
// ignored.
absl::Status CheckCapabilities(const DeviceCapabilities& device, const Geometry& geometry,
                               const FrameLayout& layout, bool calibrated = false);

}  // namespace voxeld::display::voxlink
