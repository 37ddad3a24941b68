// The commands for recordings if VOXELD_RECORDING is off.
#include "tools/voxelctl/playlist/play_list.h"
#include "tools/voxelctl/record/record.h"
#include "tools/voxelctl/text/not_built.h"

namespace voxeld::voxelctl {
namespace {

absl::Status NoRecording(absl::string_view command) {
  return NotBuilt(command, "has no recording", "it", "VOXELD_RECORDING");
}

}  // namespace

absl::Status Record(const RecordOptions&, const Connector&, Interrupt&, Console&) {
  return NoRecording("record");
}

absl::Status Replay(const ReplayOptions&, const Connector&, Interrupt&, std::istream&, Console&) {
  return NoRecording("replay");
}

WeekMinute LocalWeekMinute() { return 0; }

absl::Status PlayList(const PlaylistOptions&, const Connector&, const std::function<WeekMinute()>&,
                      Interrupt&, Console&) {
  return NoRecording("playlist");
}

}  // namespace voxeld::voxelctl
