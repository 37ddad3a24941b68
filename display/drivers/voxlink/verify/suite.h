// voxlink's conformance suite: the requirements of docs/protocols/voxlink.md on a device that a
// host can observe.
#pragma once

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/conformance/suite.h"

namespace voxeld::display::voxlink {

struct Configured {
  Geometry geometry;
  FrameLayout layout;
  bool calibrated = false;  // as in CheckCapabilities
};

// `configured`: the configured description of the device; null: none.
conformance::Suite MakeSuite(const Configured* configured);

}  // namespace voxeld::display::voxlink
