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
  uint64_t owner = 0;
  std::vector<std::string> notes;  // of shapes that are drawn otherwise than asked; for a terminal
  std::vector<std::string> stay;   // of what others have up that was not to be; for a terminal
  std::vector<std::string> not_showing;  // of displays that show nothing now; for a terminal
};

// All of them or none; with `add` beside what is in the layer, else in its place. What others have in a layer of that
// name goes too, if the caller may take it away.
absl::StatusOr<ShapesPut> PutShapes(const v1::ApplyUpdateRequest& request, bool add,
                                    Connection& connection);

}  // namespace voxeld::voxelctl
