// Parses playlist files, and determines which item is due when. Performs no I/O except reading the
// file.
//
//   cross_fade = 2            # seconds between two items; default 1
//   loop = true               # begin again at the end; default true
//   [[item]]
//   file = "night.mcap"       # what voxelctl record has written; relative to the playlist's folder
//   seconds = 60              # how long; default: as long as the recording, and a preset needs it
//   speed = 0.5               # times as fast as it was; default 1
//   from = "22:00"            # local time of day: only then; default: always
//   to = "06:00"              # not later; earlier than `from`: of the next day
//   days = ["fri", "sat"]     # only when `from` is on one of these; default: every day
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::voxelctl {

// A time in the week, in minutes since Monday 0:00.
using WeekMinute = int;
inline constexpr WeekMinute kDayMinutes = 24 * 60, kWeekMinutes = 7 * kDayMinutes;

struct Hours {
  int from = 0, to = kDayMinutes;  // minutes of the day; `to` not after `from`: on the next day
  uint8_t days = 0x7F;             // bit 0: Monday
};

bool IsWithin(const Hours& hours, WeekMinute now);

struct PlaylistItem {
  std::string file;  // relative to the working directory
  std::optional<double> seconds;
  double speed = 1;
  Hours hours;
};

struct Playlist {
  double cross_fade_s = 1;
  bool loop = true;
  std::vector<PlaylistItem> items;
};

// Errors: InvalidArgument with every fault, one per line, each as "path:line:column: what is wrong,
// the value, what would be valid"; NotFound if the file does not exist.
absl::StatusOr<Playlist> ReadPlaylist(const std::string& path);
absl::StatusOr<Playlist> ParsePlaylist(std::string_view text, const std::string& path);

// Returns the item after `after` (nothing: the first) whose hours include `now`; nothing if there
// is none. Without `loop`, also nothing after the last item.
std::optional<size_t> NextItem(const Playlist& playlist, std::optional<size_t> after,
                               WeekMinute now);

}  // namespace voxeld::voxelctl
