// The commands for lights if VOXELD_LIGHTS is off.
#include "tools/voxelctl/lights/lights.h"
#include "tools/voxelctl/text/not_built.h"

namespace voxeld::voxelctl {

absl::Status Input(const InputOptions&, const Connector&, Interrupt&, Console&) {
  return NotBuilt("input", "has no LED inputs", "them", "VOXELD_LIGHTS");
}

absl::Status Pipe(const PipeOptions&, const Connector&, Interrupt&, int, Console&) {
  return NotBuilt("pipe", "has no LED inputs", "them", "VOXELD_LIGHTS");
}

}  // namespace voxeld::voxelctl
