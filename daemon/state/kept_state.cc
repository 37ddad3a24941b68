#include "daemon/state/kept_state.h"

#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/core/scene_watch.h"
#include "daemon/state/restore.h"
#include "daemon/text/fonts.h"

namespace voxeld::daemon::state {
namespace {

int64_t UnixNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

absl::StatusOr<std::unique_ptr<KeptState>> KeptState::Open(const std::string& dir,
                                                           sync::TimeNs interval_ns,
                                                           sync::Clock& clock, Logger& log) {
  if (mkdir(dir.c_str(), 0700) != 0 && errno != EEXIST) {
    return absl::ErrnoToStatus(errno, absl::StrCat("the state's folder ", dir));
  }
  absl::StatusOr<std::unique_ptr<StateFile>> file = StateFile::Open(
      {.path = absl::StrCat(dir, "/state.db"), .now = [] { return UnixNs() / sync::kSecond; }});
  if (!file.ok()) return file.status();
  std::unique_ptr<KeptState> state(new KeptState(interval_ns, clock, log));
  state->file_ = *std::move(file);
  return state;
}

absl::Status KeptState::Restore(Core& core) {
  text::Fonts fonts;
  const wire::TwoClocks now{clock_.Now(), UnixNs()};
  absl::StatusOr<RestoredState> restored =
      ReadState(*file_, now, core.limits(), &core.bulk(), &fonts);
  if (absl::IsDataLoss(restored.status())) {
    absl::Status anew = file_->StartAnew(std::string(restored.status().message()));
    if (!anew.ok()) return anew;
    restored = RestoredState();
  }
  if (!restored.ok()) return restored.status();
  const OwnerRecords owners = restored->scene.owners;
  const std::vector<Issue> issues = core.Restore(std::move(restored->scene));
  for (const std::string& why : restored->why) log_.Error("not restored", {{"why", why}});
  for (const Issue& issue : issues) log_.Error("not restored", {{"why", issue.message}});
  if (!file_->quarantined().empty()) {
    log_.Error("the state file was damaged and put aside", {{"put_aside", file_->quarantined()}});
  }
  log_.Info("restored", {{"layers", absl::StrCat(restored->layers)},
                         {"entities", absl::StrCat(restored->entities)},
                         {"objects", absl::StrCat(restored->objects)},
                         {"owners", absl::StrCat(owners.size())}});
  keeper_ = std::make_unique<Keeper>(std::move(file_),
                                     KeeperOptions{.interval_ns = interval_ns_,
                                                   .unix_ns = [](sync::TimeNs) { return UnixNs(); },
                                                   .log = &log_},
                                     clock_);
  if (restored->left_out + restored->expired + issues.size() == 0) {
    keeper_->Knows(core.scene_watch().newest(), owners);
  }
  keeper_->SetOnDurable([&core](uint64_t snapshot) { core.OnDurable(snapshot); });
  sink_.to = keeper_.get();
  return absl::OkStatus();
}

void KeptState::Stop() {
  if (keeper_ == nullptr) return;
  if (absl::Status status = keeper_->Stop(); !status.ok()) {
    log_.Error("the last state could not be kept", {{"why", std::string(status.message())}});
  }
}

}  // namespace voxeld::daemon::state
