// Converts a server's error about a drawing to the words in which it was typed.
#pragma once

#include <span>
#include <string>

#include "absl/status/status.h"

namespace voxeld::voxelctl {

// `refused` is the response to ShapesRequest(shapes). Replaces the operation's path by the shape as
// it was typed and the error of its field; a message of another form stays unchanged.
absl::Status AsTyped(const absl::Status& refused, std::span<const std::string> shapes);

}  // namespace voxeld::voxelctl
