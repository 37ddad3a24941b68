// What room there is for a scene.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {

struct Room {
  DisplaySpace space;
  std::array<uint32_t, 2> voxels = {
      512, 512};  // across and up, of the display that has the most; without a display as it stands
  int least_side =
      128;  // voxels, of the display that has the fewest along an axis; without a display as it stands
};

// What the display `name` shows, or all of the server's if it is empty: what is common to them, or the first one's if nothing
// is. A server without displays is told. NotFound names those that there are.
absl::StatusOr<Room> ChooseSpace(Connection& connection, const std::string& name, Console& console);

}  // namespace voxeld::voxelctl
