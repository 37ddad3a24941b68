// Whether words are a program (program.h) that may be run.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"

namespace voxeld::gpu::implicit {

// Over so many positions of rings. InvalidArgument says what is wrong, with the value. Nothing is
// run that has not passed this.
absl::Status CheckProgram(std::span<const uint32_t> words, uint32_t positions);

}  // namespace voxeld::gpu::implicit
