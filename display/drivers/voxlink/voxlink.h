// A voxlink display on the machine's USB.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/drivers/driver_context.h"
#include "display/drivers/options.h"

namespace voxeld::display::voxlink {

// README.md lists the options.
absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context);

}  // namespace voxeld::display::voxlink
