// The drivers that this build has: the list in display/drivers/CMakeLists.txt.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/drivers/options.h"
#include "display/sync/clock.h"

namespace voxeld::display {

// A stopped display. InvalidArgument for an unknown driver, an unknown option or a bad value, with
// what would be right. `clock` outlives the display.
absl::StatusOr<std::unique_ptr<Display>> CreateDisplay(const DisplayOptions& options,
                                                       sync::Clock& clock);

// Ascending.
std::vector<std::string> DriverNames();

}  // namespace voxeld::display
