// What streaming would be at its simplest: packets that are ready in memory, handed to libusb as fast as
// it takes them. What a driver is compared with.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "display/api/slice_frame.h"

namespace voxeld::bench {

struct PlainResult {
  uint64_t volumes = 0, bytes = 0;
  double seconds = 0;
};

// Streams volumes of `layout` to the first voxlink device of the system for about `seconds`, with
// the device's geometry unchecked. Internal with what libusb or the device said when anything is
// not as it should be: every volume must be shown.
absl::StatusOr<PlainResult> StreamPlainly(const display::FrameLayout& layout, double seconds);

}  // namespace voxeld::bench
