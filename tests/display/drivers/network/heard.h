// A display whose packets are received by a socket on this machine.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/drivers/options.h"
#include "display/sync/clock.h"

namespace voxeld::display::network {

// Creates a display from options, whatever their port: it sends to a socket of this machine on a
// port that was free, which receives everything as long as the display lives.
absl::StatusOr<std::unique_ptr<Display>> CreateHeard(const DisplayOptions& options,
                                                     sync::Clock& clock);

}  // namespace voxeld::display::network
