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

// The size (ChangesByOwner) from which an owner's change is prepared by a second engine. A display's engine applies and
// draws a smaller one within a few volumes.
inline constexpr uint64_t kLargeChange = 4096;

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
  kSlices,
  kPosts,
  kFrames
};

// What the configuration says of a display beyond its driver's part.
struct DisplaySetup {
  ViewOptions view;
  std::string genlock;       // the name of its group; empty: it goes by itself
  double power_limit_w = 0;  // 0: none
  double power_full_w = 0;   // what the display draws at full white; 0: not known
};

struct DisplayDescription {
  display::DisplayInfo info;
  display::DisplayState state = display::DisplayState::kStopped;
  std::string state_reason;
  double brightness = 1;
  bool blank = false;
  double power_limit_w = 0;
  std::string genlock;
  TestPattern pattern = TestPattern::kNone;
  ViewOptions view;
  gpu::Affine scene_to_voxel;
};

struct DisplayUpdate {
  std::optional<double> brightness;
  std::optional<bool> blank;
  std::optional<double> power_limit_w;
  std::optional<TestPattern> pattern;
  std::optional<ViewOptions> view;
};

}  // namespace voxeld::daemon
