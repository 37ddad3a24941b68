// A display whose packets somebody on this machine listens to.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/drivers/options.h"
#include "display/sync/clock.h"

namespace voxeld::display::network {

// From options, whatever their port: to a socket of this machine's on one that was free, which takes what comes for as long as the
// display lives.
absl::StatusOr<std::unique_ptr<Display>> CreateHeard(const DisplayOptions& options,
                                                     sync::Clock& clock);

}  // namespace voxeld::display::network
