// The command for markers if VOXELD_MARKERS is off.
#include "tools/voxelctl/markers/follow.h"
#include "tools/voxelctl/text/not_built.h"

namespace voxeld::voxelctl {

absl::Status FollowMarkers(const MarkersOptions&, const Connector&, Interrupt&, Console&) {
  return NotBuilt("markers", "has no marker client", "it", "VOXELD_MARKERS");
}

}  // namespace voxeld::voxelctl
