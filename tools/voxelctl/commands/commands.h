// The commands of voxelctl. Each writes its data and messages to the console and returns a status
// whose message is for people; Cancelled means that an interrupt ended it early.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/address.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Reads the files before it connects: nothing is shown unless all of them can be.
absl::Status Play(const PlayOptions& options, const Connector& connect, Interrupt& interrupt,
                  Console& console);
// Reads the next scene while the previous one plays. Removes everything that it showed at the end.
absl::Status Demo(const DemoOptions& options, const Connector& connect, Interrupt& interrupt,
                  Console& console);
// Draws nothing unless all shapes are valid and accepted by the server.
absl::Status Draw(const DrawOptions& options, const Connector& connect, Console& console);
// Draws every shape alone, as the display shows it, into one picture; the layer is empty
// afterwards.
absl::Status Gallery(const GalleryOptions& options, Connection& connection, Interrupt& interrupt,
                     Console& console);
// Captures a volume that shows everything that was in the scene at the call. If none comes in the
// options' time, uses an older one and reports it.
absl::Status Snapshot(const SnapshotOptions& options, Connection& connection, Console& console);
// Renders a turntable of what a display shows. An interrupt leaves nothing except completed PNGs.
absl::Status Render(const TurntableOptions& options, Connection& connection, Interrupt& interrupt,
                    Console& console);
// Writes the shown volume to a file for other programs.
absl::Status Export(const ExportOptions& options, Connection& connection, Console& console);
absl::Status Displays(Connection& connection, Console& console);
absl::Status ShowStats(const StatsOptions& options, Connection& connection, Interrupt& interrupt,
                       Console& console);
absl::Status Entities(const EntitiesOptions& options, Connection& connection, Console& console);
// Prints the server's explanation of an entity's visibility.
absl::Status Assets(const AssetsOptions& options, Connection& connection, Interrupt& interrupt,
                    Console& console);
absl::Status Why(const WhyOptions& options, Connection& connection, Console& console);
absl::Status Watch(const WatchOptions& options, Connection& connection, Interrupt& interrupt,
                   Console& console);
absl::Status Clear(const ClearOptions& options, Connection& connection, Console& console);
absl::Status Pattern(const PatternOptions& options, Connection& connection, Console& console);
absl::Status Set(const SetOptions& options, Connection& connection, Console& console);
void ListPatterns(Console& console);
// Prints names for a shell, one per line; nothing, without a message, if the server does not answer
// promptly.
absl::Status Complete(const CompleteOptions& options, const Connector& connect,
                      Interrupt& interrupt, Console& console);
absl::Status WriteManual(const ManualOptions& options);

// Connects if the command needs it, runs it, and reports errors. Returns: the exit code.
int Run(const Options& options, const Environment& environment, Interrupt& interrupt,
        Console& console);

}  // namespace voxeld::voxelctl
