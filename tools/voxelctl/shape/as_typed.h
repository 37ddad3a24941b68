// What a server says of a drawing, in the words in which it was typed.
#pragma once

#include <span>
#include <string>

#include "absl/status/status.h"

namespace voxeld::voxelctl {

// `refused` is the answer to ShapesRequest(shapes). Instead of the operation's path it then has the shape as it was typed,
// and what is wrong with its field; a message of another form stays as it is.
absl::Status AsTyped(const absl::Status& refused, std::span<const std::string> shapes);

}  // namespace voxeld::voxelctl
