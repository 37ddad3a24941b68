// Determines the space for a scene.
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
      512, 512};  // across and up, of the display with the most; this default without a display
  int least_side =
      128;  // voxels of the smallest axis of any display; this default without a display
};

// Returns the space of display `name`. If it is empty, returns the common space of all the server's
// displays, or the first one's if there is no common space. Reports a server without displays on
// the console. Errors: NotFound with the existing names.
absl::StatusOr<Room> ChooseSpace(Connection& connection, const std::string& name, Console& console);

}  // namespace voxeld::voxelctl
