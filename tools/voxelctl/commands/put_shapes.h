// Shapes into the layer of voxelctl.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

struct ShapesPut {
  uint64_t snapshot = 0;
  std::vector<std::string> notes;  // of shapes that are drawn otherwise than asked; for a terminal
};

// All of them or none; with `add` beside what is in the layer, else in its place.
absl::StatusOr<ShapesPut> PutShapes(const v1::ApplyUpdateRequest& request, bool add,
                                    Connection& connection);

}  // namespace voxeld::voxelctl
