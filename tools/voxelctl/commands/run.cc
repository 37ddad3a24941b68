#include <unistd.h>

#include <iostream>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/calibrate/calibrate.h"
#include "tools/voxelctl/cli/server_options.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/doctor/doctor.h"
#include "tools/voxelctl/init/init.h"
#include "tools/voxelctl/lights/lights.h"
#include "tools/voxelctl/markers/follow.h"
#include "tools/voxelctl/playlist/play_list.h"
#include "tools/voxelctl/profile/profile.h"
#include "tools/voxelctl/record/record.h"
#include "tools/voxelctl/token/token.h"
#include "tools/voxelctl/top/top.h"
#include "tools/voxelctl/verify/verify.h"

namespace voxeld::voxelctl {
namespace {

absl::Status Dispatch(const Options& options, const Environment& environment,
                      const Connector& connect, Interrupt& interrupt, Console& console) {
  if (const auto* play = std::get_if<PlayOptions>(&options.command))
    return Play(*play, connect, interrupt, console);
  if (const auto* demo = std::get_if<DemoOptions>(&options.command))
    return Demo(*demo, connect, interrupt, console);
  if (const auto* draw = std::get_if<DrawOptions>(&options.command))
    return Draw(*draw, connect, console);
  if (const auto* pattern = std::get_if<PatternOptions>(&options.command);
      pattern != nullptr && pattern->list) {
    ListPatterns(console);
    return absl::OkStatus();
  }
  if (const auto* verify = std::get_if<VerifyOptions>(&options.command))
    return Verify(*verify, interrupt, console);
  if (std::holds_alternative<DoctorOptions>(options.command))
    return Doctor(ThisMachine(), options.server, console);
  if (const auto* init = std::get_if<InitOptions>(&options.command)) {
    return Init(*init, std::cin, console);
  }
  if (const auto* token = std::get_if<TokenOptions>(&options.command)) {
    return MakeToken(*token, console);
  }
  if (const auto* calibrate = std::get_if<CalibrateOptions>(&options.command)) {
    return Calibrate(*calibrate, std::cin, console);
  }
  if (const auto* profile = std::get_if<ProfileOptions>(&options.command))
    return ShowProfile(*profile, console);
  if (const auto* complete = std::get_if<CompleteOptions>(&options.command))
    return Complete(*complete, connect, interrupt, console);
  if (const auto* manual = std::get_if<ManualOptions>(&options.command))
    return WriteManual(*manual);
  if (const auto* playlist = std::get_if<PlaylistOptions>(&options.command))
    return PlayList(*playlist, connect, LocalWeekMinute, interrupt, console);
  if (const auto* record = std::get_if<RecordOptions>(&options.command))
    return Record(*record, connect, interrupt, console);
  if (const auto* replay = std::get_if<ReplayOptions>(&options.command))
    return Replay(*replay, connect, interrupt, std::cin, console);
  if (const auto* input = std::get_if<InputOptions>(&options.command))
    return Input(*input, connect, interrupt, console);
  if (const auto* pipe = std::get_if<PipeOptions>(&options.command))
    return Pipe(*pipe, connect, interrupt, STDIN_FILENO, console);
  if (const auto* markers = std::get_if<MarkersOptions>(&options.command))
    return FollowMarkers(*markers, connect, interrupt, console);
  absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  Connection& connection = **connected;
  return std::visit(
      [&](const auto& command) -> absl::Status {
        using Command = std::decay_t<decltype(command)>;
        if constexpr (std::is_same_v<Command, SnapshotOptions>)
          return Snapshot(command, connection, console);
        if constexpr (std::is_same_v<Command, TurntableOptions>)
          return Render(command, connection, interrupt, console);
        if constexpr (std::is_same_v<Command, ExportOptions>)
          return Export(command, connection, console);
        if constexpr (std::is_same_v<Command, GalleryOptions>)
          return Gallery(command, connection, interrupt, console);
        if constexpr (std::is_same_v<Command, DisplaysOptions>)
          return Displays(connection, console);
        if constexpr (std::is_same_v<Command, StatsOptions>)
          return ShowStats(command, connection, interrupt, console);
        if constexpr (std::is_same_v<Command, TopOptions>)
          return Top(command, environment("NO_COLOR").empty(), connection, interrupt, console);
        if constexpr (std::is_same_v<Command, EntitiesOptions>)
          return Entities(command, connection, console);
        if constexpr (std::is_same_v<Command, WhyOptions>) return Why(command, connection, console);
        if constexpr (std::is_same_v<Command, AssetsOptions>)
          return Assets(command, connection, interrupt, console);
        if constexpr (std::is_same_v<Command, WatchOptions>)
          return Watch(command, connection, interrupt, console);
        if constexpr (std::is_same_v<Command, ClearOptions>)
          return Clear(command, connection, console);
        if constexpr (std::is_same_v<Command, PatternOptions>)
          return Pattern(command, connection, console);
        if constexpr (std::is_same_v<Command, SetOptions>) return Set(command, connection, console);
        return absl::OkStatus();
      },
      options.command);
}

int ExitCode(const Options& options, const absl::Status& status) {
  if (std::holds_alternative<VerifyOptions>(options.command)) {
    if (absl::IsInvalidArgument(status)) return kExitUsage;
    if (absl::IsUnavailable(status)) return kExitNoDevice;
  }
  if (std::holds_alternative<ProfileOptions>(options.command) &&
      (absl::IsInvalidArgument(status) || absl::IsNotFound(status))) {
    return kExitUsage;
  }
  return kExitFailure;
}

}  // namespace

int Run(const Options& options, const Environment& environment, Interrupt& interrupt,
        Console& console) {
  const std::string server = ChooseServer(options.server, environment);
  if (const absl::StatusOr<std::string> target = ServerTarget(server); !target.ok()) {
    console.Say(absl::StrCat("voxelctl: ", target.status().message()));
    return kExitUsage;
  }
  const auto connect = [&] {
    return Connection::Connect(server, ChooseCredentials(options.credentials, environment),
                               interrupt);
  };
  const absl::Status status = Dispatch(options, environment, connect, interrupt, console);
  console.EndProgress();
  if (status.ok()) return kExitOk;
  if (absl::IsCancelled(status) && interrupt.requested()) {
    console.Say("voxelctl: interrupted");
    return kExitInterrupted;
  }
  console.Say(absl::StrCat("voxelctl: ", status.message()));
  return ExitCode(options, status);
}

}  // namespace voxeld::voxelctl
