// Shapes into the layer of voxelctl.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

// What is to be sent. InvalidArgument names each shape that is not understood, and what would have been.
absl::StatusOr<v1::ApplyUpdateRequest> ShapesRequest(std::span<const std::string> shapes);

// All of them or none; with `add` beside what is in the layer, else in its place. The snapshot they are in.
absl::StatusOr<uint64_t> PutShapes(const v1::ApplyUpdateRequest& request, bool add,
                                   Connection& connection);

}  // namespace voxeld::voxelctl
