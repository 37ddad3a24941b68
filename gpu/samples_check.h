// Checks whether words are a grid of samples (primitives/samples.h) that is safe to read.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"

namespace voxeld::gpu {

// Errors: InvalidArgument that says what is wrong, with the value. Words that have not passed this
// check are not read.
absl::Status CheckSamples(std::span<const uint32_t> words);

}  // namespace voxeld::gpu
