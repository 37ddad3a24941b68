#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/files/whole_file.h"
#include "tools/voxelctl/profile/profile.h"

namespace voxeld::voxelctl {
namespace {

constexpr sync::TimeNs kPatience = 700 * sync::kMillisecond;

std::set<std::string> Live(const CompleteOptions& options, Connection& connection) {
  std::set<std::string> names;
  if (options.kind == "displays") {
    const absl::StatusOr<v1::ListDisplaysResponse> response = connection.ListDisplays();
    if (!response.ok()) return names;
    for (const v1::DisplayDescription& display : response->displays()) names.insert(display.name());
    return names;
  }
  v1::ListEntitiesRequest request;
  if (options.kind == "entities") {
    request.set_id_prefix(options.beginning);
  } else {
    request.set_page_size(1);  // only the layers are needed
  }
  const absl::StatusOr<v1::ListEntitiesResponse> response =
      connection.ListEntities(std::move(request), /*first_page_only=*/true);
  if (!response.ok()) return names;
  if (options.kind == "entities") {
    for (const v1::EntityInfo& entity : response->entities()) names.insert(entity.key().id());
  }
  for (const v1::LayerInfo& layer : response->layers()) {
    if (options.kind == "layers") names.insert(layer.layer());
    if (options.kind == "owners") names.insert(absl::StrCat(layer.owner()));
  }
  return names;
}

}  // namespace

absl::Status Complete(const CompleteOptions& options, const Connector& connect,
                      Interrupt& interrupt, Console& console) {
  std::set<std::string> names;
  if (options.kind == "profiles") {
    for (const std::string& name : ProfileNames()) names.insert(name);
  } else {
    // The user is waiting at a prompt, so a late answer is useless.
    Interrupt answered(Interrupt::Watch::kNothing);
    std::thread timer([&] {
      sync::SystemClock clock;
      if (!answered.WaitUntil(clock, clock.Now() + kPatience)) interrupt.Request();
    });
    const absl::Cleanup join = [&] {
      answered.Request();
      timer.join();
    };
    const absl::StatusOr<std::unique_ptr<Connection>> connection = connect();
    if (connection.ok()) names = Live(options, **connection);
  }
  std::string out;
  for (const std::string& name : names) {
    // A name that a terminal would not show unchanged is not put into a command line either.
    const bool plain = !name.empty() && EscapeForTerminal(name) == name;
    if (plain && absl::StartsWith(name, options.beginning)) absl::StrAppend(&out, name, "\n");
  }
  console.Data(out);
  return absl::OkStatus();
}

absl::Status WriteManual(const ManualOptions& options) {
  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (error) {
    return absl::PermissionDeniedError(absl::StrCat(
        EscapeForTerminal(options.folder), ": no folder can be made there: ", error.message()));
  }
  for (const auto& [name, page] : options.pages) {
    const absl::Status status =
        WriteWholeFile((std::filesystem::path(options.folder) / name).string(), page);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
