// What people set on a display, and what they are told about it. Words only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "display/api/display.h"
#include "display/api/geometry.h"
#include "display/api/outcome.h"
#include "gpu/affine.h"

namespace voxeld::daemon {

// How the scene is laid into a display's volume.
struct ViewOptions {
  enum class Mode : uint8_t { kFit, kMillimetres, kVoxels };
  Mode mode = Mode::kFit;
  // kFit; default ±1 on the longest axis.
  std::optional<std::pair<display::Vec3, display::Vec3>> box;
  gpu::Affine transform;
};

enum class TestPattern : uint8_t {
  kNone,
  kAxes,
  kCorners,
  kGrid,
  kRamp,
  kWhite,
  kBars,
  kDensity,
  kSlices
};

struct DisplayDescription {
  display::DisplayInfo info;
  display::DisplayState state = display::DisplayState::kStopped;
  std::string state_reason;
  double brightness = 1;
  bool blank = false;
  TestPattern pattern = TestPattern::kNone;
  ViewOptions view;
  gpu::Affine scene_to_voxel;
};

struct DisplayUpdate {
  std::optional<double> brightness;
  std::optional<bool> blank;
  std::optional<TestPattern> pattern;
  std::optional<ViewOptions> view;
};

}  // namespace voxeld::daemon
