#include "daemon/reload/reloader.h"

#include <future>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "daemon/config/display_view.h"

namespace voxeld::daemon::reload {
namespace {

// Calls `ask` and waits for its answer.
template <typename T, typename Ask>
absl::StatusOr<T> Answer(const Ask& ask) {
  const auto promise = std::make_shared<std::promise<absl::StatusOr<T>>>();
  std::future<absl::StatusOr<T>> answer = promise->get_future();
  ask([promise](absl::StatusOr<T> value) { promise->set_value(std::move(value)); });
  return answer.get();
}

absl::Status Update(Core& core, NamedUpdate update) {
  return Answer<DisplayDescription>([&](auto reply) {
           core.UpdateDisplay(std::move(update.name), std::move(update.update), std::move(reply));
         })
      .status();
}

bool SameView(const ViewOptions& one, const ViewOptions& other) {
  return one.mode == other.mode && one.box == other.box;
}

// Returns: the changes that the file makes to a display, or nothing if it makes none.
absl::StatusOr<std::optional<DisplayUpdate>> UpdateOf(const DisplayConfig& in_force,
                                                      const DisplayConfig& wanted) {
  const absl::StatusOr<DisplayOptions> before = SplitDisplayOptions(in_force);
  if (!before.ok()) return before.status();
  const absl::StatusOr<DisplayOptions> after = SplitDisplayOptions(wanted);
  if (!after.ok()) return after.status();
  DisplayUpdate update;
  if (!SameView(before->setup.view, after->setup.view)) update.view = after->setup.view;
  if (before->setup.power_limit_w != after->setup.power_limit_w) {
    update.power_limit_w = after->setup.power_limit_w;
  }
  if (!update.view.has_value() && !update.power_limit_w.has_value()) return std::nullopt;
  return update;
}

std::string Listed(const std::vector<std::string>& keys) {
  return keys.empty() ? "nothing" : absl::StrJoin(keys, " ");
}

}  // namespace

Reloader::Reloader(Config in_force, CommandLine command_line, Environment environment,
                   const Parts& parts)
    : in_force_(std::move(in_force)),
      command_line_(std::move(command_line)),
      environment_(std::move(environment)),
      parts_(parts) {}

absl::StatusOr<Config> Reloader::Read() const {
  const std::optional<std::string> file =
      in_force_.file.empty() ? command_line_.config : std::optional(in_force_.file);
  absl::StatusOr<Config> config = LoadConfig(file, environment_);
  if (!config.ok()) return config;
  if (absl::Status status = ApplyCommandLine(command_line_, &*config); !status.ok()) return status;
  if (absl::Status status = CheckSecurity(*config); !status.ok()) return status;
  if (const auto local = LocalSocketAddress(config->server); !local.ok()) return local.status();
  for (const DisplayConfig& display : config->displays) {
    const absl::Status status = SplitDisplayOptions(display).status();
    if (!status.ok()) {
      return absl::Status(status.code(), absl::StrCat(display.source, ": ", status.message()));
    }
  }
  return config;
}

absl::StatusOr<Changes> Reloader::Reload() {
  absl::StatusOr<Config> wanted = Read();
  absl::StatusOr<Changes> changes = wanted.ok() ? Take(*wanted) : wanted.status();
  std::string trouble;
  if (!changes.ok()) {
    trouble = absl::StrReplaceAll(changes.status().message(), {{"\n", "; "}});
    parts_.log.Error("the configuration is wrong: the one in force stays", {{"why", trouble}});
  } else {
    parts_.log.Info("the configuration was read again",
                    {{"changed", Listed(changes->at_once)},
                     {"changes_with_a_restart", Listed(changes->at_restart)}});
  }
  const sync::MutexLock lock(mutex_);
  trouble_ = std::move(trouble);
  return changes;
}

std::string Reloader::trouble() const {
  const sync::MutexLock lock(mutex_);
  return trouble_;
}

absl::StatusOr<Changes> Reloader::Take(const Config& wanted) {
  Changes changes = Compare(in_force_, wanted);
  const absl::StatusOr<Logger::Level> level = Logger::ParseLevel(wanted.log.level);
  if (!level.ok()) return level.status();
  const absl::StatusOr<access::AccessOptions> options = AccessOf(wanted.security);
  if (!options.ok()) return options.status();
  Config taken = Taken(in_force_, wanted);
  std::vector<NamedUpdate> undo;
  absl::Status status = TakeDisplays(taken, &undo);
  // If only the content of the grants file has changed, Access reloads it without this call.
  if (status.ok() && changes.access) status = parts_.access.Change(*options);
  if (!status.ok()) {
    for (NamedUpdate& before : undo) (void)Update(parts_.core, std::move(before));
    return status;
  }
  parts_.log.SetLevel(*level);
  parts_.log.SetLinesPerSecond(wanted.log.max_lines_per_second);
  in_force_ = std::move(taken);
  return changes;
}

absl::Status Reloader::TakeDisplays(const Config& wanted, std::vector<NamedUpdate>* undo) {
  for (size_t i = 0; i < wanted.displays.size(); ++i) {
    const DisplayConfig& display = wanted.displays[i];
    const auto wrong = [&display](const absl::Status& status) {
      return absl::Status(status.code(),
                          absl::StrCat("display ", display.name, ": ", status.message()));
    };
    const absl::StatusOr<std::optional<DisplayUpdate>> update =
        UpdateOf(in_force_.displays[i], display);
    if (!update.ok()) return wrong(update.status());
    if (!update->has_value()) continue;
    const absl::StatusOr<DisplayDescription> before = Answer<DisplayDescription>(
        [&](auto reply) { parts_.core.GetDisplay(display.name, std::move(reply)); });
    if (!before.ok()) return wrong(before.status());
    if (absl::Status status = Update(parts_.core, {display.name, **update}); !status.ok()) {
      return wrong(status);
    }
    NamedUpdate back{display.name, {}};
    if ((*update)->view.has_value()) back.update.view = before->view;
    if ((*update)->power_limit_w.has_value()) back.update.power_limit_w = before->power_limit_w;
    undo->push_back(std::move(back));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::daemon::reload
