// A display's options that are the daemon's own, not its driver's: how the scene is laid into it.
#pragma once

#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "daemon/config/display_config.h"
#include "daemon/pipeline/display_settings.h"

namespace voxeld::daemon {

struct DisplayOptions {
  ViewOptions view;
  std::map<std::string, std::string> driver;  // what is left
};

// `view` is fit, millimetres or voxels; with fit, `view_box` may be x0;y0;z0;x1;y1;z1 in scene
// units. InvalidArgument with the value and what would be right.
absl::StatusOr<DisplayOptions> SplitDisplayOptions(const DisplayConfig& display);

}  // namespace voxeld::daemon
