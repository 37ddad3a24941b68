// Whether words are a grid of samples (primitives/samples.h) that may be looked into.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"

namespace voxeld::gpu {

// InvalidArgument says what is wrong, with the value. Nothing is read that has not passed this.
absl::Status CheckSamples(std::span<const uint32_t> words);

}  // namespace voxeld::gpu
