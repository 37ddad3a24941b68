// Captures what a display shows, for commands that need it.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

struct ShownVolume {
  Volume volume;
  bool up_to_date = false;  // shows everything that was in the scene at the call
  bool decoded = false;     // from the sent bytes; otherwise reported by the device
};

// Captures from `display` (empty: the first), waiting up to `timeout_s` for a volume that shows
// everything in the scene. If none comes, or the newest snapshot is unknown, uses an older volume
// and reports it on the console.
absl::StatusOr<ShownVolume> CaptureShown(const std::string& display, double timeout_s,
                                         Connection& connection, Console& console);

// Captures whatever it shows now.
absl::StatusOr<ShownVolume> CaptureNow(const std::string& display, Connection& connection);

// Returns the number of slice pixels that are not black.
uint64_t LitPixels(const Volume& volume);

// Returns "volume 7 of display stack, 123 slice pixels lit, decoded from the bytes sent", escaped
// for a terminal.
std::string ShownText(const ShownVolume& shown);

// The message if nothing is lit.
inline constexpr const char* kNothingLit =
    "no pixel is lit: see `voxelctl entities` for what is up, `voxelctl stats` for where it went";

}  // namespace voxeld::voxelctl
