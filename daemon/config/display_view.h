// A display's options that are the daemon's own, not its driver's: how the scene is laid into it, which GPUs draw it, with
// which others it goes in step, and how much power it may draw.
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
  std::vector<int> gpus;                      // empty: as the engine's configuration says
  std::map<std::string, std::string> driver;  // what is left
};

// `profile` is the name or path of a profile (display/profiles/profile.h), whose options are added to those that are given. `view` is
// fit, millimetres or voxels; with fit, `view_box` may be x0;y0;z0;x1;y1;z1 in scene
// units. `gpus` is numbers of GPUs, apart by semicolons. `genlock` is the name of a group; `power_limit` and `power_full` are
// watts. InvalidArgument with the value and what would
// be right.
absl::StatusOr<DisplayOptions> SplitDisplayOptions(const DisplayConfig& display);

// Whether such an engine can draw a display of so many slices on those GPUs, as far as can be said
// without looking for them. InvalidArgument says why not.
absl::Status CheckGpus(const std::vector<int>& gpus, gpu::EngineKind kind, int32_t slices);

}  // namespace voxeld::daemon
