// Encodes a Target as flat bytes, for another process.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

std::vector<std::byte> EncodeTarget(const Target& target);
// Errors: InvalidArgument for malformed bytes. Does not check whether the target is consistent.
absl::StatusOr<Target> DecodeTarget(std::span<const std::byte> bytes);

}  // namespace voxeld::gpu
