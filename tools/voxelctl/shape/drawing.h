// What a command line draws, as one request: shapes, and
//
//   object NAME: SHAPE   a part of an object, which "instance object=NAME" draws
//   mask: SHAPE          only what lies in voxels of such shapes is seen of the others
//   clip_… …             as shape_text.h has it
//
// in any order.
#pragma once

#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

// Whatever voxelctl puts up lies in this layer.
inline constexpr const char* kLayer = "voxelctl";
// What a draw masks that with, not seen itself.
inline constexpr const char* kMaskLayer = "voxelctl mask";

// What is to be sent. InvalidArgument names each shape that is not understood, and what would have been.
absl::StatusOr<v1::ApplyUpdateRequest> ShapesRequest(std::span<const std::string> shapes);

}  // namespace voxeld::voxelctl
