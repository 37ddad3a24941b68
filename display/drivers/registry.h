// The drivers that this build has: the list in display/drivers/CMakeLists.txt.
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

// A stopped display. InvalidArgument for an unknown driver, an unknown option or a bad value, with
// what would be right; whatever context.usb says, of a driver that needs it.
absl::StatusOr<std::unique_ptr<Display>> CreateDisplay(const DisplayOptions& options,
                                                       const DriverContext& context);

// The devices that a display with these options would drive, each with its protocol's conformance
// suite. Nothing is opened. Errors as CreateDisplay's.
absl::StatusOr<std::vector<conformance::Subject>> VerifySubjects(const DisplayOptions& options,
                                                                 const DriverContext& context);

// Ascending.
std::vector<std::string> DriverNames();

}  // namespace voxeld::display
