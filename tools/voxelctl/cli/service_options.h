// Commands for people who run a daemon and test devices: arguments and their checks. Within this
// folder, errors are thrown (UsageError).
#pragma once

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
}

namespace voxeld::voxelctl {

// References passed in live as long as the app.
void AddTopOptions(CLI::App* command, TopOptions* options);

void AddTokenOptions(CLI::App* command, TokenOptions* options);
void AddVerifyOptions(CLI::App* command, VerifyOptions* options);
void AddRecordOptions(CLI::App* command, RecordOptions* options);
void AddPlaylistOptions(CLI::App* command, PlaylistOptions* options);
void CheckPlaylistOptions(const PlaylistOptions& options);
void AddMarkersOptions(CLI::App* command, MarkersOptions* options);
void CheckMarkersOptions(const MarkersOptions& options);
void AddReplayOptions(CLI::App* command, ReplayOptions* options);
void AddWhyOptions(CLI::App* command, WhyOptions* options);

void CheckTokenOptions(const TokenOptions& options);
void CheckRecordOptions(const RecordOptions& options);
void CheckReplayOptions(const ReplayOptions& options);
void CheckWhyOptions(const WhyOptions& options);

}  // namespace voxeld::voxelctl
