#include "tools/voxelctl/calibrate/trial.h"

#include <algorithm>
#include <future>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/config/display_view.h"
#include "display/drivers/registry.h"

namespace voxeld::voxelctl {
namespace {

constexpr sync::TimeNs kStopLimit = 2 * sync::kSecond;

// Waits for the reply to a call of the core.
template <typename T, typename Call>
absl::StatusOr<T> Await(const Call& call) {
  auto promise = std::make_shared<std::promise<absl::StatusOr<T>>>();
  std::future<absl::StatusOr<T>> answer = promise->get_future();
  call([promise](absl::StatusOr<T> value) { promise->set_value(std::move(value)); });
  return answer.get();
}

}  // namespace

Trial::Trial(display::DisplayInfo info, sync::Clock& clock)
    : info_(std::move(info)), core_({.version = "calibrate"}, clock) {}

Trial::~Trial() { core_.Stop(kStopLimit).IgnoreError(); }

absl::StatusOr<std::unique_ptr<Trial>> Trial::Start(const daemon::DisplayConfig& display,
                                                    const display::DriverContext& context,
                                                    daemon::TestPattern pattern,
                                                    sync::TimeNs limit) {
  const absl::StatusOr<daemon::DisplayOptions> options = daemon::SplitDisplayOptions(display);
  if (!options.ok()) return options.status();
  absl::StatusOr<std::unique_ptr<display::Display>> made = display::CreateDisplay(
      {.name = display.name, .driver = display.driver, .options = options->driver}, context);
  if (!made.ok()) return made.status();
  std::unique_ptr<Trial> trial(new Trial((*made)->info(), context.clock));
  gpu::EngineOptions engine;
  engine.kind = gpu::EngineKind::kCpu;
  if (absl::Status status = trial->core_.AddDisplay(*std::move(made), engine); !status.ok()) {
    return status;
  }
  if (absl::Status status = trial->core_.Start(); !status.ok()) return status;
  if (absl::Status status = trial->Show(pattern); !status.ok()) return status;
  // The next volume that is shown contains the pattern.
  const absl::StatusOr<display::DecodedVolume> shown = Await<display::DecodedVolume>(
      [&](auto reply) { trial->core_.Capture("", limit, 0, std::move(reply)); });
  if (!shown.ok()) {
    const auto state = Await<daemon::DisplayDescription>(
        [&](auto reply) { trial->core_.GetDisplay("", std::move(reply)); });
    return absl::UnavailableError(absl::StrCat(
        "display \"", display.name, "\" does not show within ", limit / sync::kSecond,
        " s: ", state.ok() ? state->state_reason : std::string(state.status().message())));
  }
  return trial;
}

absl::Status Trial::Show(daemon::TestPattern pattern) {
  return Await<daemon::DisplayDescription>(
             [&](auto reply) { core_.UpdateDisplay("", {.pattern = pattern}, std::move(reply)); })
      .status();
}

}  // namespace voxeld::voxelctl
