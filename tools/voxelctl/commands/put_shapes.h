// Draws shapes into the layer of voxelctl.
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
  // About shapes that are drawn differently than requested; for a terminal.
  std::vector<std::string> notes;
  // About others' layers that should have been removed; for a terminal.
  std::vector<std::string> stay;
  std::vector<std::string> not_showing;  // about displays that show nothing now; for a terminal
};

// Draws all shapes or none. With `add` they are added to the layer, otherwise they replace its
// contents. Layers of that name of other owners are removed too if the caller has the scope.
absl::StatusOr<ShapesPut> PutShapes(const v1::ApplyUpdateRequest& request, bool add,
                                    Connection& connection);

}  // namespace voxeld::voxelctl
