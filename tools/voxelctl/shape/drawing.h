// Converts a drawing of a command line to one request. It consists of shapes, and
//
//   object NAME: SHAPE   a part of an object, which "instance object=NAME" draws
//   mask: SHAPE          the others are visible only in voxels of such shapes
//   clip_… …             as in shape_text.h
//
// in any order.
#pragma once

#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

// The layer of everything that voxelctl draws.
inline constexpr const char* kLayer = "voxelctl";
// The layer of masks, which are not visible themselves.
inline constexpr const char* kMaskLayer = "voxelctl mask";

// Returns the request to send. Errors: InvalidArgument with each invalid shape, and what would have
// been valid.
absl::StatusOr<v1::ApplyUpdateRequest> ShapesRequest(std::span<const std::string> shapes);

}  // namespace voxeld::voxelctl
