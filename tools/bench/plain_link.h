// Streaming at its simplest, as a reference for a driver: packets that are ready in memory are
// passed to libusb as fast as it accepts them.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "display/api/slice_frame.h"

namespace voxeld::bench {

struct PlainResult {
  uint64_t volumes = 0, bytes = 0;
  double seconds = 0;
};

// Streams volumes of `layout` to the first voxlink device of the system for about `seconds`,
// without checking the device's geometry. Every volume must be shown; otherwise returns Internal
// with the message of libusb or the device.
absl::StatusOr<PlainResult> StreamPlainly(const display::FrameLayout& layout, double seconds);

}  // namespace voxeld::bench
