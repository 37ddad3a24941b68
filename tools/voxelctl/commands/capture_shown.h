// What a display shows, asked for by a command that wants to see it.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

struct ShownVolume {
  Volume volume;
  bool up_to_date = false;  // it shows all that was up when it was asked for
  bool decoded = false;     // from the bytes sent; else reported by the device
};

// Of `display` (empty: the first), waiting up to `timeout_s` for a volume that shows all that is up. Where none comes, or the
// newest is not known, an older one is taken, and the console told.
absl::StatusOr<ShownVolume> CaptureShown(const std::string& display, double timeout_s,
                                         Connection& connection, Console& console);

// Whatever it shows now.
absl::StatusOr<ShownVolume> CaptureNow(const std::string& display, Connection& connection);

// Slice pixels that are not black.
uint64_t LitPixels(const Volume& volume);

// "volume 7 of display stack, 123 slice pixels lit, decoded from the bytes sent", fit for a terminal.
std::string ShownText(const ShownVolume& shown);

// What to say where nothing is lit.
inline constexpr const char* kNothingLit =
    "no pixel is lit: see `voxelctl entities` for what is up, `voxelctl stats` for where it went";

}  // namespace voxeld::voxelctl
