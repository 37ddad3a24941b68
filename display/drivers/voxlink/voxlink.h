// Creates a voxlink display on the machine's USB.
#pragma once

#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/conformance/suite.h"
#include "display/drivers/driver_context.h"
#include "display/drivers/options.h"

namespace voxeld::display::voxlink {

// README.md lists the options.
absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context);

// Returns the device that `options` select and its conformance suite. Options that describe more
// than which device it is are checked by a case.
absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context);

}  // namespace voxeld::display::voxlink
