// What voxelctl does. Each command writes its data and words to the console and returns a status
// whose message is for people; Cancelled means that an interrupt ended it before its end.
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

// Reads the files before it connects: nothing is put up unless all of them can be.
absl::Status Play(const PlayOptions& options, const Connector& connect, Interrupt& interrupt,
                  Console& console);
// Reads what it plays while it plays what is before it; all that it put up is gone at its end.
absl::Status Demo(const DemoOptions& options, const Connector& connect, Interrupt& interrupt,
                  Console& console);
// Nothing is put up unless all shapes are understood, and taken by the server.
absl::Status Draw(const DrawOptions& options, const Connector& connect, Console& console);
// Every shape by itself, as the display shows it, in one picture; the layer is empty afterwards.
absl::Status Gallery(const GalleryOptions& options, Connection& connection, Interrupt& interrupt,
                     Console& console);
// Of a volume that shows all that was up when it was called; of an older one, which is told, if none
// comes in the options' time.
absl::Status Snapshot(const SnapshotOptions& options, Connection& connection, Console& console);
// A turntable of what a display shows; nothing is left of one that an interrupt ends, but PNGs that were whole.
absl::Status Render(const TurntableOptions& options, Connection& connection, Interrupt& interrupt,
                    Console& console);
// The volume as it is shown, in a file for other programs.
absl::Status Export(const ExportOptions& options, Connection& connection, Console& console);
absl::Status Displays(Connection& connection, Console& console);
absl::Status ShowStats(const StatsOptions& options, Connection& connection, Interrupt& interrupt,
                       Console& console);
absl::Status Entities(const EntitiesOptions& options, Connection& connection, Console& console);
// What the server says of an entity's visibility.
absl::Status Assets(const AssetsOptions& options, Connection& connection, Interrupt& interrupt,
                    Console& console);
absl::Status Why(const WhyOptions& options, Connection& connection, Console& console);
absl::Status Watch(const WatchOptions& options, Connection& connection, Interrupt& interrupt,
                   Console& console);
absl::Status Clear(const ClearOptions& options, Connection& connection, Console& console);
absl::Status Pattern(const PatternOptions& options, Connection& connection, Console& console);
absl::Status Set(const SetOptions& options, Connection& connection, Console& console);
void ListPatterns(Console& console);
// Names for a shell, a line each; none, and no word, where the server does not answer at once.
absl::Status Complete(const CompleteOptions& options, const Connector& connect,
                      Interrupt& interrupt, Console& console);
absl::Status WriteManual(const ManualOptions& options);

// Connects if the command needs it, runs it, says what went wrong; the exit code.
int Run(const Options& options, const Environment& environment, Interrupt& interrupt,
        Console& console);

}  // namespace voxeld::voxelctl
