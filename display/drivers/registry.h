// The drivers of this build: the list in display/drivers/CMakeLists.txt.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/conformance/suite.h"
#include "display/drivers/driver_context.h"
#include "display/drivers/options.h"

namespace voxeld::display {

// Creates a stopped display. Errors: InvalidArgument for an unknown driver, an unknown option or a
// bad value, with what is expected; the error of context.usb, for a driver that needs it.
absl::StatusOr<std::unique_ptr<Display>> CreateDisplay(const DisplayOptions& options,
                                                       const DriverContext& context);

// Returns the devices that a display with these options would drive, each with its protocol's
// conformance suite. Opens nothing. Errors as for CreateDisplay.
absl::StatusOr<std::vector<conformance::Subject>> VerifySubjects(const DisplayOptions& options,
                                                                 const DriverContext& context);

// Returns the drivers' names, ascending.
std::vector<std::string> DriverNames();

}  // namespace voxeld::display
