// Takes all descriptors of a running daemon, releases them, and measures when it accepts again.
#pragma once

#include <optional>

#include "tests/e2e/voxeld_process.h"

namespace voxeld::e2e {

// Lowers the daemon's limit, connects until it has failed to accept, and closes everything. Returns
// the seconds from then until a new client's call was answered; nullopt if one of these did not
// happen within a generous time. The limit remains: later tests run under it.
std::optional<double> ExhaustAndRecover(const Daemon& daemon);

}  // namespace voxeld::e2e
