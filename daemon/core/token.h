// Names that cannot be guessed: 16 random bytes of the system's.
#pragma once

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"

namespace voxeld::daemon {

inline constexpr size_t kTokenBytes = 16;

// Unavailable if the system has no random bytes to give. Reentrant.
absl::StatusOr<std::string> NewToken();

}  // namespace voxeld::daemon
