// Checks whether words are a program (program.h) that is safe to run.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"

namespace voxeld::gpu::implicit {

// `positions`: the number of positions for rings. Errors: InvalidArgument says what is wrong, with
// the value. Programs that have not passed this check are not run.
absl::Status CheckProgram(std::span<const uint32_t> words, uint32_t positions);

}  // namespace voxeld::gpu::implicit
