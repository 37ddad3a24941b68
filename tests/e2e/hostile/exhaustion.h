// Takes all descriptors of a running daemon, gives them back, and sees when it accepts again.
#pragma once

#include <optional>

#include "tests/e2e/voxeld_process.h"

namespace voxeld::e2e {

// Lowers the daemon's limit, connects until it has failed to accept, closes all. The seconds from
// then until a new client's call was answered; nothing if one of these did not happen in a generous
// time. The limit stays: what follows runs under it.
std::optional<double> ExhaustAndRecover(const Daemon& daemon);

}  // namespace voxeld::e2e
