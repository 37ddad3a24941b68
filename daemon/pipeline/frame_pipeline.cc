#include "daemon/pipeline/frame_pipeline.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "daemon/pipeline/test_pattern.h"
#include "daemon/pipeline/view.h"
#include "gpu/delta.h"

namespace voxeld::daemon {
namespace {

// After a failure of the engine, without a new commit.
constexpr sync::TimeNs kEngineRetryDelay = sync::kSecond;

std::string WhyNotShowing(const display::Display& display) {
  return absl::StrCat("the display was ", display::DisplayStateName(display.state()), ": ",
                      display.state_reason());
}

}  // namespace

absl::StatusOr<std::unique_ptr<FramePipeline>> FramePipeline::Create(Options options) {
  const absl::StatusOr<gpu::Affine> map =
      SceneToVoxel(options.view, options.display->info().geometry.grid);
  if (!map.ok()) return map.status();
  std::unique_ptr<FramePipeline> pipeline(new FramePipeline(std::move(options)));
  pipeline->scene_to_voxel_ = *map;
  absl::StatusOr<std::unique_ptr<gpu::Engine>> engine =
      pipeline->make_engine_(pipeline->engine_options_);
  if (!engine.ok()) return engine.status();
  pipeline->engine_ = *std::move(engine);
  pipeline->engine_info_ = pipeline->engine_->info();
  return pipeline;
}

FramePipeline::FramePipeline(Options options)
    : clock_(*options.clock),
      work_(std::move(options.work)),
      display_(std::move(options.display)),
      make_engine_(std::move(options.make_engine)),
      engine_options_(options.engine),
      tell_(std::move(options.tell)),
      retire_(std::move(options.retire)),
      view_(options.view),
      scene_([this] { Breathe(); }),
      pool_(display_->info().layout),
      riders_(display_->info().name,
              [this](const Rider& rider, const CommitOutcome& outcome) { Told(rider, outcome); }) {}

FramePipeline::~FramePipeline() { Stop(); }

absl::Status FramePipeline::Start() {
  const absl::Status status = display_->Start(this, [work = work_] { work->Wake(); });
  started_ = status.ok();
  return status;
}

void FramePipeline::Stop() {
  if (started_) display_->Stop();
  started_ = false;
  riders_.LoseUnsubmitted("the display was stopped", true);
  // The engine's end comes before the buffer that it may be writing into is let go.
  alive_ = nullptr;
  engine_ = nullptr;
  drawing_.reset();
  ServeCaptures();
}

sync::TimeNs FramePipeline::Step() {
  if (!started_) return sync::kNever;
  do {
    next_tick_ = display_->Tick();
    ServeCaptures();
  } while (MaybeDraw());
  sync::TimeNs next = next_tick_;
  for (const PendingCapture& capture : captures_) next = std::min(next, capture.deadline);
  if (show_again_ && !drawing_.has_value() && showing() && display_->mailbox_free()) {
    next = std::min(next, show_again_at_);
  }
  return next;
}

void FramePipeline::Breathe() {
  if (clock_.Now() >= next_tick_) next_tick_ = display_->Tick();
}

void FramePipeline::Retire(SnapshotPtr snapshot) {
  if (snapshot != nullptr && retire_) retire_(std::move(snapshot));
}

void FramePipeline::Show(SnapshotPtr snapshot) {
  Retire(std::exchange(newest_, std::move(snapshot)));
}

void FramePipeline::Show(SnapshotPtr snapshot, const Rider& rider, bool hidden) {
  Show(std::move(snapshot));
  switch (display_->state()) {
    case display::DisplayState::kStopped:
      return riders_.NotShown(rider, CommitOutcome::NotShown::kRemoved);
    case display::DisplayState::kAttaching:
    case display::DisplayState::kLost:
      return riders_.NotShown(rider, CommitOutcome::NotShown::kAbsent);
    case display::DisplayState::kBlanked:
      return riders_.NotShown(rider, CommitOutcome::NotShown::kBlanked);
    case display::DisplayState::kShowing:
      break;
  }
  if (hidden || pattern_ != TestPattern::kNone) {
    return riders_.NotShown(rider, CommitOutcome::NotShown::kHidden);
  }
  riders_.Board(rider);
}

// ----------------------------------------------------------------------------------- drawing

bool FramePipeline::HaveEngine() {
  if (engine_ != nullptr) return true;
  absl::StatusOr<std::unique_ptr<gpu::Engine>> engine = make_engine_(engine_options_);
  if (!engine.ok()) {
    engine_info_.reason = std::string(engine.status().message());
    return false;
  }
  engine_ = *std::move(engine);
  engine_info_ = engine_->info();
  if (!takeover_.empty()) engine_info_.reason = takeover_;
  return true;
}

bool FramePipeline::MaybeDraw() {
  if (drawing_.has_value() || newest_ == nullptr || !showing() || !display_->mailbox_free()) {
    return false;
  }
  const bool changed = newest_->number != drawn_snapshot_ || settings_changed_;
  if (!changed && !(show_again_ && clock_.Now() >= show_again_at_)) return false;

  const SnapshotPtr newest = newest_;
  drawn_snapshot_ = newest->number;
  settings_changed_ = false;
  riders_.Draw();
  if (!HaveEngine()) {
    OnEngineFailure(absl::UnavailableError(absl::StrCat("no engine: ", engine_info_.reason)));
    return true;
  }
  SnapshotPtr held = scene_.held();
  const size_t size = scene_.Plan(pattern_scene_ != nullptr ? pattern_scene_ : newest);
  Retire(std::move(held));
  if (size == 0 && !target_stale_ && !show_again_ && last_submitted_ != 0) {
    KeepUnchanged({newest->number, settings_});
    return true;
  }

  Drawing& drawing = drawing_.emplace(Drawing{});
  drawing.contents = {newest->number, settings_};
  drawing.volume = ++last_volume_;
  drawing.lease = pool_.Acquire();
  if (target_stale_) {
    target_stale_ = false;
    const display::DisplayInfo& info = display_->info();
    engine_->SetTarget({info.geometry, info.layout, info.tone,
                        pattern_ == TestPattern::kNone ? scene_to_voxel_ : gpu::Affine()},
                       Completion(&FramePipeline::OnCallDone));
  }
  if (const absl::Status status = ApplyDelta(size); !status.ok()) {
    drawing_.reset();
    OnEngineFailure(status);
    return true;
  }
  display::SliceFrame& frame = *drawing.lease.frame;
  engine_->SubmitFrame({drawing.volume, drawing.lease.holds}, {frame.bytes, frame.changed_in},
                       Completion(&FramePipeline::OnFrame));
  return true;
}

absl::Status FramePipeline::ApplyDelta(size_t size) {
  if (size == 0) return absl::OkStatus();
  absl::StatusOr<gpu::StagingBlock> block = engine_->AcquireStaging(size);
  if (!block.ok()) return block.status();
  gpu::DeltaWriter writer(block->bytes());
  scene_.Write(writer);
  if (writer.overrun() || writer.size() != size) {
    return absl::InternalError(
        absl::StrFormat("a delta planned as %d bytes came out as %d", size, writer.size()));
  }
  engine_->Apply(*std::move(block), size, Completion(&FramePipeline::OnCallDone));
  return absl::OkStatus();
}

template <typename Result>
std::function<void(Result)> FramePipeline::Completion(
    void (FramePipeline::*method)(const Result&)) {
  return [this, method, work = work_, alive = std::weak_ptr<bool>(alive_),
          volume = drawing_->volume](Result result) {
    work->Post([this, method, alive, volume, result = std::move(result)] {
      if (alive.lock() == nullptr || !drawing_.has_value() || drawing_->volume != volume) return;
      (this->*method)(result);
    });
  };
}

void FramePipeline::OnCallDone(const absl::Status& status) {
  if (drawing_->status.ok()) drawing_->status = status;
}

void FramePipeline::OnFrame(const absl::StatusOr<gpu::FrameResult>& result) {
  Drawing drawing = *std::move(drawing_);
  drawing_.reset();
  if (!drawing.status.ok()) return OnEngineFailure(drawing.status);
  if (!result.ok()) return OnEngineFailure(result.status());

  lost_engine_ = false;
  drawing.lease.frame->volume = drawing.volume;
  ++volumes_drawn_;
  lit_voxels_ = result->lit_voxels;
  singular_drawables_ = result->singular_drawables;
  const sync::TimeNs now = clock_.Now();
  assemble_.Add(now, result->assemble_ns);
  slice_.Add(now, result->slice_ns);

  if (!showing()) {
    riders_.LoseUnsubmitted(WhyNotShowing(*display_), false);
    return ShowAgain(0);
  }
  if (!result->changed && !show_again_ && last_submitted_ != 0) {
    ++volumes_unchanged_;
    return KeepUnchanged(drawing.contents);
  }
  SubmitDrawn(std::move(drawing));
}

void FramePipeline::KeepUnchanged(const Contents& contents) {
  const auto it = in_display_.find(last_submitted_);
  if (it != in_display_.end()) {
    it->second = contents;
  } else {
    shown_ = contents;
  }
  riders_.Unchanged(last_submitted_);
}

void FramePipeline::SubmitDrawn(Drawing drawing) {
  show_again_ = false;
  last_submitted_ = drawing.volume;
  in_display_[drawing.volume] = drawing.contents;
  riders_.Submit(drawing.volume);
  display_->Submit(std::move(drawing.lease.frame));
}

void FramePipeline::ShowAgain(sync::TimeNs delay) {
  show_again_ = true;
  show_again_at_ = clock_.Now() + delay;
}

void FramePipeline::OnEngineFailure(const absl::Status& status) {
  Retire(scene_.held());
  scene_.Forget();
  target_stale_ = true;
  if (absl::IsDataLoss(status)) {
    engine_ = nullptr;
    pool_.Forget(last_volume_);
    // Whatever it was, the next is on the CPU, in this process: made at once, with the same bytes.
    engine_options_.kind = gpu::EngineKind::kCpu;
    engine_options_.in_worker = false;
    takeover_ = absl::StrCat("took over from ", gpu::EngineKindName(engine_info_.kind), ": ",
                             status.message());
    if (!std::exchange(lost_engine_, true) && HaveEngine() && showing()) {
      riders_.Redraw();
      if (pattern_ != TestPattern::kNone) riders_.HideWaiting();
      drawn_snapshot_.reset();
      return ShowAgain(0);
    }
  }
  riders_.LoseUnsubmitted(absl::StrCat("the engine failed: ", status.ToString()), false);
  ShowAgain(kEngineRetryDelay);
}

// -------------------------------------------------------------------------- from the display

void FramePipeline::OnOutcome(const display::VolumeOutcome& outcome) {
  const auto it = in_display_.find(outcome.volume);
  if (it != in_display_.end()) {
    const Contents contents = it->second;
    in_display_.erase(it);
    if (outcome.kind == display::VolumeOutcome::Kind::kPresented) {
      presented_rate_.Add(clock_.Now());
      if (!shown_ || contents.snapshot >= shown_->snapshot) shown_ = contents;
    }
  }
  if (outcome.kind == display::VolumeOutcome::Kind::kLost && outcome.volume == last_submitted_) {
    // A display that still shows sends what it lost again by itself;
    // when it comes back it gets it anew.
    show_again_ = true;
    show_again_at_ = sync::kNever;
  }
  riders_.OnOutcome(outcome);
}

void FramePipeline::OnState(display::DisplayState state, const std::string&) {
  if (state == display::DisplayState::kShowing) {
    if (show_again_) show_again_at_ = std::min(show_again_at_, clock_.Now());
    return;
  }
  riders_.LoseUnsubmitted(WhyNotShowing(*display_), true);
}

void FramePipeline::Told(const Rider& rider, const CommitOutcome& outcome) {
  if (outcome.kind == CommitOutcome::Kind::kPresented) {
    const sync::TimeNs now = clock_.Now();
    commit_to_presented_.Add(now, outcome.time_ns - rider.accepted_ns);
    if (outcome.last_byte_ns != 0) {
      commit_to_last_byte_.Add(now, outcome.last_byte_ns - rider.accepted_ns);
    }
  }
  tell_(rider, outcome);
}

// ---------------------------------------------------------------------------------- requests

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
  const double brightness = display_->brightness();
  const bool blank = display_->blanked();
  absl::Status status;
  if (update.brightness.has_value()) status = display_->SetBrightness(*update.brightness);
  if (status.ok() && update.blank.has_value()) status = display_->SetBlank(*update.blank);
  if (!status.ok()) {
    absl::Status back;
    if (display_->blanked() != blank) back.Update(display_->SetBlank(blank));
    if (display_->brightness() != brightness) back.Update(display_->SetBrightness(brightness));
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
  description.brightness = display_->brightness();
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
  figures.engine = gpu::EngineKindName(engine_info_.kind);
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
  figures.commit_to_last_byte = commit_to_last_byte_.Summary(now);
  figures.commit_to_presented = commit_to_presented_.Summary(now);
  figures.assemble = assemble_.Summary(now);
  figures.slice = slice_.Summary(now);
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
        capture.done(absl::DeadlineExceededError(absl::StrFormat(
            "no volume with snapshot %d or a newer one was shown in time; the newest has %d",
            capture.at_least.snapshot, shown_ ? shown_->snapshot : 0)));
      }
      continue;
    }
    if (!showing()) {
      capture.done(absl::UnavailableError(WhyNotShowing(*display_)));
      continue;
    }
    display_->Capture(capture.deadline == sync::kNever ? sync::kNever : capture.deadline - now,
                      std::move(capture.done), capture.id);
  }
  captures_.insert(captures_.end(), std::make_move_iterator(waiting.begin()),
                   std::make_move_iterator(waiting.end()));
}

}  // namespace voxeld::daemon
