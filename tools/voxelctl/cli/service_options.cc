#include "tools/voxelctl/cli/service_options.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include "absl/strings/match.h"
#include "tools/voxelctl/cli/argument_checks.h"

namespace voxeld::voxelctl {

void AddTopOptions(CLI::App* command, TopOptions* options) {
  command->add_flag("--once", options->once, "As a table, and end");
  AddNumber(command, "--interval", &options->interval_s, 0.1, 3600, "Seconds between, 0.1 to 3600",
            "S");
  command->add_option("--display", options->display, "Look at this one first (default: the first)")
      ->type_name("NAME");
}

void AddTokenOptions(CLI::App* command, TokenOptions* options) {
  command->add_option("NAME", options->name,
                      "Whose it is: all that is drawn with it belongs to it");
  command->add_option("--scopes", options->scopes, "What it allows: view, draw, control")
      ->type_name("LIST")
      ->capture_default_str();
  command->add_option("--grants", options->grants, "Append the entry to this file")
      ->type_name("FILE");
  AddNumber(command, "--days", &options->days, 0, 36500, "Days until it expires; 0: never", "N");
}

void CheckTokenOptions(const TokenOptions& options) {
  if (options.name.empty()) throw UsageError{"token wants a NAME, such as stage-left"};
}

void AddVerifyOptions(CLI::App* command, VerifyOptions* options) {
  command->add_option("DISPLAY", options->display, "[NAME=]DRIVER[,KEY=VALUE…]");
  command
      ->add_option("--filter", options->filter,
                   "Only the cases whose names match: 'volume.*', '@(volume|end).*', '!(usb.*)'")
      ->type_name("GLOB");
  command->add_flag("--list", options->list, "Name the cases and end; no device is needed");
  command->add_option("--junit", options->junit, "Write JUnit's XML too, for build servers")
      ->type_name("FILE");
  command
      ->add_option("--seed", options->seed,
                   "What the cases choose by chance: sizes of transfers, order of pictures")
      ->type_name("N")
      ->capture_default_str();
  WantNumber(command->get_option("--seed"), 0, 4294967295.0);
  AddNumber(command, "--wait", &options->wait_s, 0, 3600,
            "Seconds to wait for the device, such as after its firmware was written", "S");
}

void AddRecordOptions(CLI::App* command, RecordOptions* options) {
  command->add_option("FILE.mcap", options->file, "Where it goes; must not be there yet");
  AddNumber(command, "--duration", &options->duration_s, 0, 1e9,
            "End after so many seconds; 0: at Ctrl-C", "S");
  command->add_flag("--still", options->still,
                    "The scene as it is now, and end: a preset, for replay --keep and playlists");
}

void CheckRecordOptions(const RecordOptions& options) {
  if (options.file.empty()) throw UsageError{"record wants the name of a file, such as show.mcap"};
  if (!absl::EndsWithIgnoreCase(options.file, ".mcap")) {
    throw UsageError{"record writes MCAP: give the file a name that ends with .mcap"};
  }
  if (options.still && options.duration_s > 0) {
    throw UsageError{"--still and --duration do not go together"};
  }
}

void AddWhyOptions(CLI::App* command, WhyOptions* options) {
  command->add_option("ID", options->id, "The entity's id (voxelctl entities lists them)");
  AddFilter(command, &options->layer, &options->owner);
  command->add_option("--display", options->display, "On this display (default: the first)")
      ->type_name("NAME");
}

void CheckWhyOptions(const WhyOptions& options) {
  if (options.id.empty()) throw UsageError{"why wants the ID of an entity; entities lists them"};
}

void AddPlaylistOptions(CLI::App* command, PlaylistOptions* options) {
  command->add_option("FILE.toml", options->file, "What is played, and when");
  command->add_flag("--check", options->check,
                    "Say what is wrong with it, or what it would play now; needs no daemon");
}

void CheckPlaylistOptions(const PlaylistOptions& options) {
  if (options.file.empty()) {
    throw UsageError{"playlist wants the name of a file, such as week.toml"};
  }
}

void AddMarkersOptions(CLI::App* command, MarkersOptions* options) {
  command->add_option("URL", options->url,
                      "A Foxglove WebSocket server, such as ws://localhost:8765");
  command
      ->add_option("--topic", options->topics,
                   "Only this one; may be given again. Else all that have a scene")
      ->type_name("NAME")
      ->expected(1);
  command->add_option("--layer", options->layer, "The layer that they are put into")
      ->type_name("NAME")
      ->capture_default_str();
}

void CheckMarkersOptions(const MarkersOptions& options) {
  if (options.url.empty()) {
    throw UsageError{"markers wants the URL of a Foxglove server, such as ws://localhost:8765"};
  }
  if (options.layer.empty()) throw UsageError{"--layer wants a name"};
}

void AddReplayOptions(CLI::App* command, ReplayOptions* options) {
  command->add_option("FILE.mcap", options->file, "What record has written");
  AddNumber(command, "--speed", &options->speed, 0.001, 1000, "Times as fast as it was", "X");
  AddNumber(command, "--from", &options->from_s, 0, 1e9, "Begin so many seconds into it", "S");
  command->add_flag("--loop", options->loop, "Begin again at the end, until Ctrl-C");
  command->add_flag(
      "--step", options->step,
      "Wait for a line on standard input before each change and before the end, whatever the time");
  command->add_flag("--keep", options->keep, "Leave the last state up");
}

void CheckReplayOptions(const ReplayOptions& options) {
  if (options.file.empty()) throw UsageError{"replay wants the name of a file, such as show.mcap"};
  if (options.loop && options.keep) throw UsageError{"--loop and --keep do not go together"};
}

}  // namespace voxeld::voxelctl
