// What FramePipeline is asked: settings, figures, captures, and what is shown, to be held against what was sent.
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "daemon/pipeline/frame_pipeline.h"
#include "daemon/pipeline/test_pattern.h"
#include "daemon/pipeline/view.h"

namespace voxeld::daemon {
namespace {

constexpr size_t kMostScenes = 8;  // volumes on their way are fewer

}  // namespace

std::string FramePipeline::WhyNotShowing() const {
  return absl::StrCat("the display was ", display::DisplayStateName(display_->state()), ": ",
                      display_->state_reason());
}

absl::Status FramePipeline::Update(const DisplayUpdate& update) {
  if (update.brightness.has_value() && !(*update.brightness >= 0 && *update.brightness <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("brightness is ", *update.brightness, "; it must be from 0 to 1"));
  }
  gpu::Affine map = scene_to_voxel_;
  if (update.view.has_value()) {
    const absl::StatusOr<gpu::Affine> made = SceneToVoxel(*update.view, info().geometry.grid);
    if (!made.ok()) return made.status();
    map = *made;
  }
  // The device's own refusals come before anything that cannot be refused;
  // what it refuses is taken back.
  const double brightness = wanted_brightness_, limit_w = wanted_limit_w_;
  const bool blank = display_->blanked();
  absl::Status status;
  if (update.power_limit_w.has_value()) status = SetPowerLimit(*update.power_limit_w);
  if (status.ok() && update.brightness.has_value()) status = SetBrightness(*update.brightness);
  if (status.ok() && update.blank.has_value()) status = display_->SetBlank(*update.blank);
  if (!status.ok()) {
    absl::Status back;
    if (display_->blanked() != blank) back.Update(display_->SetBlank(blank));
    if (wanted_brightness_ != brightness) back.Update(SetBrightness(brightness));
    if (wanted_limit_w_ != limit_w) back.Update(SetPowerLimit(limit_w));
    if (back.ok()) return status;
    return absl::Status(status.code(),
                        absl::StrCat(status.message(), "; and taking it back: ", back.message()));
  }
  if (update.view.has_value()) {
    view_ = *update.view;
    if (map != scene_to_voxel_) {
      target_stale_ = settings_changed_ = true;
      ++settings_;
    }
    scene_to_voxel_ = map;
  }
  if (update.pattern.has_value() && *update.pattern != pattern_) {
    pattern_ = *update.pattern;
    if (pattern_ == TestPattern::kNone) {
      pattern_scene_ = nullptr;
    } else {
      pattern_scene_ = MakePattern(pattern_, info().geometry, 0);
      riders_.HideWaiting();
    }
    target_stale_ = settings_changed_ = true;
    ++settings_;
  }
  return absl::OkStatus();
}

DisplayDescription FramePipeline::Describe() const {
  DisplayDescription description;
  description.info = info();
  description.state = display_->state();
  description.state_reason = display_->state_reason();
  description.brightness = wanted_brightness_;
  description.power_limit_w = wanted_limit_w_;
  description.genlock = setup_.genlock;
  description.blank = display_->blanked();
  description.pattern = pattern_;
  description.view = view_;
  description.scene_to_voxel = scene_to_voxel_;
  return description;
}

DisplayFigures FramePipeline::Figures() const {
  const sync::TimeNs now = clock_.Now();
  const display::DisplayStats& display = display_->stats();
  DisplayFigures figures;
  figures.name = info().name;
  figures.state = display_->state();
  figures.state_reason = display_->state_reason();
  if (made_.engine != nullptr) figures.engine = gpu::EngineKindName(engine_info_.kind);
  figures.engine_device = engine_info_.device;
  figures.engine_reason = engine_info_.reason;
  figures.lit_voxels = lit_voxels_;
  figures.singular_drawables = singular_drawables_;
  figures.volumes_drawn = volumes_drawn_;
  figures.volumes_unchanged = volumes_unchanged_;
  figures.volumes_presented = display.volumes_presented;
  figures.volumes_replaced = display.volumes_replaced;
  figures.volumes_lost = display.volumes_lost;
  figures.volumes_per_second = presented_rate_.PerSecond(now);
  figures.bytes_out = display.bytes_out;
  figures.slices_sent = display.slices_sent;
  figures.slices_resent = display.slices_resent;
  figures.underruns = display.underruns;
  figures.attaches = display.attaches;
  figures.transfers_failed = display.transfers_failed;
  figures.device_trouble = link_.trouble(now);
  figures.volumes_late = display.volumes_late;
  figures.sweeps = display_->Sweeps().value_or(sync::SweepLock());
  if (genlock_ != nullptr) {
    const Genlock::Figures lock = genlock_->figures();
    figures.genlock_volumes = lock.volumes;
    figures.genlock_dropped = lock.dropped;
    figures.genlock_postponed = lock.postponed;
    figures.genlock_slips = lock.slips;
  }
  AddLight(figures);
  figures.commit_to_last_byte = commit_to_last_byte_.Summary(now);
  figures.commit_to_presented = commit_to_presented_.Summary(now);
  if (care_ != nullptr) care_->AddTo(figures);
  if (!refused_.empty()) {
    figures.engine_degraded = refused_;
    figures.volume_held = true;
  }
  figures.assemble = assemble_.Summary(now);
  figures.slice = slice_.Summary(now);
  figures.copy = copy_.Summary(now);
  figures.packed_as_drawn = packed_as_drawn_;
  figures.waiting = waiting_.Summary(now);
  figures.transferring = transferring_.Summary(now);
  figures.showing = showing_.Summary(now);
  const RiderBook::Counts& counts = riders_.counts();
  figures.commits_owed = counts.owed;
  figures.commits_presented = counts.presented;
  figures.commits_unchanged = counts.unchanged;
  figures.commits_superseded = counts.superseded;
  figures.commits_lost = counts.lost;
  figures.commits_not_shown = counts.not_shown;
  figures.commits_pending = riders_.pending();
  return figures;
}

void FramePipeline::Capture(sync::TimeNs timeout, uint64_t at_least_snapshot,
                            display::Display::CaptureDone done, display::CaptureId id) {
  const sync::TimeNs now = clock_.Now();
  captures_.push_back({timeout < sync::kNever - now ? now + timeout : sync::kNever,
                       {at_least_snapshot, settings_},
                       std::move(done),
                       id});
  if (!started_) ServeCaptures();  // no Step will
}

void FramePipeline::CancelCapture(display::CaptureId id) {
  std::vector<PendingCapture> waiting;
  for (PendingCapture& capture : std::exchange(captures_, {})) {
    if (capture.id == id) {
      capture.done(absl::CancelledError("the capture was cancelled"));
    } else {
      waiting.push_back(std::move(capture));
    }
  }
  captures_ = std::move(waiting);
  display_->CancelCapture(id);
}

void FramePipeline::Watch(uint64_t id, display::Display::Watcher watcher) {
  if (!started_) return watcher(absl::UnavailableError(WhyNotShowing()));
  if (watched_.has_value()) watcher(*watched_);
  watchers_[id] = std::move(watcher);
  let_go_at_ = sync::kNever;
  if (std::exchange(watching_, true)) return;
  display_->Watch(
      [this](const absl::StatusOr<display::DecodedVolume>& volume) { TellWatchers(volume); });
}

void FramePipeline::Unwatch(uint64_t id) {
  if (watchers_.erase(id) > 0 && watchers_.empty()) let_go_at_ = clock_.Now() + kWatchLinger;
}

sync::TimeNs FramePipeline::LetGoOfWatch() {
  if (clock_.Now() < let_go_at_) return let_go_at_;
  let_go_at_ = sync::kNever;
  watching_ = false;
  watched_.reset();
  display_->Unwatch();
  return sync::kNever;
}

void FramePipeline::TellWatchers(const absl::StatusOr<display::DecodedVolume>& volume) {
  if (volume.ok()) {
    watched_ = *volume;
    for (const auto& [id, watcher] : watchers_) watcher(volume);
    return;
  }
  watched_.reset();
  watching_ = false;
  let_go_at_ = sync::kNever;
  for (const auto& [id, watcher] : std::exchange(watchers_, {})) watcher(volume);
}

void FramePipeline::ServeCaptures() {
  const sync::TimeNs now = clock_.Now();
  std::vector<PendingCapture> waiting;
  for (PendingCapture& capture : std::exchange(captures_, {})) {
    const display::DisplayState state = display_->state();
    if (state == display::DisplayState::kAttaching || (showing() && !shown_) ||
        (showing() && (shown_->snapshot < capture.at_least.snapshot ||
                       shown_->settings < capture.at_least.settings))) {
      if (now < capture.deadline) {
        waiting.push_back(std::move(capture));
      } else {
        capture.done(absl::DeadlineExceededError(
            !showing()
                ? absl::StrCat("timed out; ", WhyNotShowing())
                : absl::StrFormat("timed out waiting for a volume with snapshot %d or newer; "
                                  "the newest one shown has %d",
                                  capture.at_least.snapshot, shown_ ? shown_->snapshot : 0)));
      }
      continue;
    }
    if (!showing()) {
      capture.done(absl::UnavailableError(WhyNotShowing()));
      continue;
    }
    display_->Capture(capture.deadline == sync::kNever ? sync::kNever : capture.deadline - now,
                      std::move(capture.done), capture.id);
  }
  captures_.insert(captures_.end(), std::make_move_iterator(waiting.begin()),
                   std::make_move_iterator(waiting.end()));
}

absl::StatusOr<ShownScene> FramePipeline::Shown() {
  if (!started_) return absl::UnavailableError(WhyNotShowing());
  keep_scenes_until_ = clock_.Now() + kScenesLinger;
  if (!watched_.has_value()) {
    return watching_ ? absl::UnavailableError("nothing has been shown yet")
                     : absl::FailedPreconditionError("nobody watches the display");
  }
  const auto kept = scenes_.find(watched_->volume);
  if (kept != scenes_.end()) return ShownScene{*watched_, kept->second};
  // What the engine holds is what the newest volume was drawn from, unless another is being drawn.
  const bool newest = watched_->volume == last_submitted_ && !drawing_.has_value();
  if (!newest || scene_->held() == nullptr) {
    return absl::UnavailableError("what the volume was drawn from is not known any more");
  }
  KeepScene(last_submitted_);
  return ShownScene{*watched_, scenes_[last_submitted_]};
}

void FramePipeline::KeepScene(uint64_t volume) {
  if (clock_.Now() >= keep_scenes_until_ || scene_->held() == nullptr) return;
  DrawnFrom& from = scenes_[volume];
  Retire(std::exchange(from.scene, scene_->held()));
  from.scene_to_voxel = target_.view;
  from.tone = target_.tone;
  const uint64_t told = watched_.has_value() ? watched_->volume : 0;
  while (scenes_.begin()->first < told || scenes_.size() > kMostScenes) {
    Retire(std::move(scenes_.begin()->second.scene));
    scenes_.erase(scenes_.begin());
  }
}

sync::TimeNs FramePipeline::LetGoOfScenes() {
  if (scenes_.empty()) return sync::kNever;
  if (clock_.Now() < keep_scenes_until_) return keep_scenes_until_;
  for (auto& [volume, from] : scenes_) Retire(std::move(from.scene));
  scenes_.clear();
  return sync::kNever;
}

}  // namespace voxeld::daemon
