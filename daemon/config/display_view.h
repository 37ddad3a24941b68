// Parses the options of a display that belong to the daemon rather than to the driver: how the
// scene is mapped to the display, which GPUs draw it, its genlock group, and its power limit.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/config/display_config.h"
#include "daemon/pipeline/display_settings.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

struct DisplayOptions {
  DisplaySetup setup;
  std::vector<int> gpus;                      // empty: as in the engine's configuration
  std::map<std::string, std::string> driver;  // the remaining options
};

// `profile` is the name or path of a profile (display/profiles/profile.h), which supplies defaults
// for options that are not given. `view` is fit, millimetres or voxels. With fit, `view_box` may be
// x0;y0;z0;x1;y1;z1 in scene units. `gpus` is a list of GPU indices separated by semicolons.
// `genlock` is the name of a group. `power_limit` and `power_full` are in watts. Errors:
// InvalidArgument with the value and the remedy.
absl::StatusOr<DisplayOptions> SplitDisplayOptions(const DisplayConfig& display);

// Checks, without looking for the GPUs, whether such an engine can draw a display with this number
// of slices on them. Errors: InvalidArgument with the reason.
absl::Status CheckGpus(const std::vector<int>& gpus, gpu::EngineKind kind, int32_t slices);

}  // namespace voxeld::daemon
