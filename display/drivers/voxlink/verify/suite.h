// voxlink's conformance suite: what docs/protocols/voxlink.md asks of a device and a host can see.
#pragma once

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/conformance/suite.h"

namespace voxeld::display::voxlink {

struct Configured {
  Geometry geometry;
  FrameLayout layout;
  bool calibrated = false;  // as CheckCapabilities has it
};

// `configured`: what the device is said to be; null: nothing is said.
conformance::Suite MakeSuite(const Configured* configured);

}  // namespace voxeld::display::voxlink
