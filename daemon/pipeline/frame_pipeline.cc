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

constexpr double kLeastFullPower = 1e-3;  // W; stands for one that is not known

}  // namespace

absl::StatusOr<std::unique_ptr<FramePipeline>> FramePipeline::Create(Options options) {
  const absl::StatusOr<gpu::Affine> map =
      SceneToVoxel(options.setup.view, options.display->info().geometry.grid);
  if (!map.ok()) return map.status();
  const auto tell_engine = options.tell_engine;
  std::unique_ptr<FramePipeline> pipeline(new FramePipeline(std::move(options)));
  pipeline->scene_to_voxel_ = *map;
  if (absl::Status status = pipeline->Open(tell_engine); !status.ok()) return status;
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
      run_aside_(std::move(options.run_aside)),
      large_change_(options.large_change),
      tell_state_(std::move(options.tell_state)),
      tell_transfers_(std::move(options.tell_transfers)),
      genlock_(std::move(options.genlock)),
      setup_(options.setup),
      wanted_limit_w_(options.setup.power_limit_w),
      limiter_(std::max(options.setup.power_full_w, kLeastFullPower)),
      view_(options.setup.view),
      scene_(std::make_unique<EngineScene>([this] { Breathe(); })),
      pool_(display_->info().layout),
      riders_(display_->info().name,
              [this](const Rider& rider, const CommitOutcome& outcome) { Told(rider, outcome); }),
      budget_(std::move(options.budget)) {
  if (genlock_ == nullptr) return;
  display_->SetHolding();
  member_ = genlock_->Add([work = work_] { work->Post([] {}); });
}

FramePipeline::~FramePipeline() { Stop(); }

absl::Status FramePipeline::Start() {
  if (wanted_limit_w_ > 0) {
    const absl::Status limit = display_->SetPowerLimit(wanted_limit_w_);
    if (!limit.ok() && !absl::IsUnimplemented(limit)) return limit;
    FollowDevice();
  }
  const absl::Status status = display_->Start(this, [work = work_] { work->Wake(); });
  started_ = status.ok();
  return status;
}

void FramePipeline::Stop() {
  if (started_) display_->Stop();
  started_ = false;
  TellWatchers(absl::UnavailableError("the display was stopped"));
  riders_.LoseUnsubmitted("the display was stopped", true);
  // The engine's end comes before the buffer that it may be writing into is let go.
  alive_ = nullptr;
  if (care_ != nullptr) care_->Stop();
  DropAside();
  made_.engine = nullptr;
  SetEngineBytes(0, 0);
  drawing_.reset();
  ServeCaptures();
}

sync::TimeNs FramePipeline::Step() {
  if (!started_) return sync::kNever;
  sync::TimeNs next_round = sync::kNever;
  do {
    if (genlock_ != nullptr) next_round = StepGenlock();
    if (limiter_.Rise(clock_.Now())) target_stale_ = settings_changed_ = true;
    Tick();
    ServeCaptures();
  } while (MaybeDraw());
  sweeps_->Set(showing() ? display_->ComingSweeps(2) : std::vector<sync::TimeNs>());
  sync::TimeNs next = std::min(
      {next_tick_, next_round, limiter_.next(), LetGoOfWatch(), LetGoOfScenes(), ReleaseSpare()});
  if (care_ != nullptr) next = std::min(next, care_->Step());
  for (const PendingCapture& capture : captures_) next = std::min(next, capture.deadline);
  // Of a genlock's member it is for the group to say when.
  const bool waits = genlock_ != nullptr && show_again_at_ <= clock_.Now();
  if (show_again_ && !waits && !drawing_.has_value() && showing() && display_->mailbox_free()) {
    next = std::min(next, show_again_at_);
  }
  if (draw_from_ > clock_.Now()) next = std::min(next, draw_from_);
  return next;
}

void FramePipeline::Breathe() {
  if (clock_.Now() >= next_tick_) Tick();
}

void FramePipeline::Tick() {
  next_tick_ = display_->Tick();
  const uint64_t failed = link_.Failed(display_->stats().transfers_failed, clock_.Now());
  if (failed > 0 && tell_transfers_) tell_transfers_(failed);
}

void FramePipeline::Retire(std::shared_ptr<const void> what) {
  if (what != nullptr && retire_) retire_(std::move(what));
}

void FramePipeline::Show(SnapshotPtr snapshot) {
  Retire(std::exchange(newest_, std::move(snapshot)));
}

void FramePipeline::Show(SnapshotPtr snapshot, const Rider& commit, bool hidden, bool urgent) {
  Rider rider = commit;
  rider.snapshot = snapshot->number;
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
  urgent_ = urgent_ || urgent;
}

// ----------------------------------------------------------------------------------- drawing
gpu::Target FramePipeline::CurrentTarget() const {
  const display::DisplayInfo& info = display_->info();
  return {info.geometry, info.layout,
          light_steps() == kLightSteps ? info.tone : Dimmed(info.tone, light_steps()),
          pattern_ == TestPattern::kNone ? scene_to_voxel_ : gpu::Affine()};
}

sync::TimeNs FramePipeline::DrawFrom() const {
  if (urgent_ || show_again_ || settings_changed_ || target_stale_ || last_submitted_ == 0 ||
      !captures_.empty()) {
    return 0;
  }
  const std::vector<sync::TimeNs> coming = display_->ComingSweeps(2);
  if (coming.size() < 2) return 0;
  return coming[0] - 2 * draw_ns_ - (coming[1] - coming[0]) / 4;
}

bool FramePipeline::MaybeDraw() {
  if (drawing_.has_value()) return false;
  if (care_ != nullptr && care_->ready()) TakeReturned();
  if (newest_ == nullptr || !showing() || !(display_->mailbox_free() || urgent_)) return false;
  const bool changed = newest_->number != drawn_snapshot_ || settings_changed_ ||
                       (show_again_ && clock_.Now() >= show_again_at_);
  const bool due = changed || IsAsideReady();
  const std::optional<Genlock::Round> round = genlock_ == nullptr ? std::nullopt : RoundToDraw(due);
  if (genlock_ == nullptr ? !due : !round.has_value()) return false;
  if (genlock_ == nullptr) {
    draw_from_ = DrawFrom();
    if (clock_.Now() < draw_from_) return false;
  }
  if (IsAsideReady() && !TakeAside() && !changed) return false;

  urgent_ = false;
  const SnapshotPtr newest = round.has_value() ? round->snapshot : newest_;
  if (care_ != nullptr) care_->Prune(*newest, pattern_scene_.get());
  drawn_snapshot_ = newest->number;
  settings_changed_ = false;
  const SnapshotPtr scene = HoldBack(newest);
  riders_.Draw(newest->number, held_back_);
  const Contents contents{WholeUpTo(newest->number), settings_};
  if (!HaveEngine()) {
    if (round.has_value()) genlock_->Failed(member_, round->volume, engine_info_.reason);
    OnEngineFailure(absl::UnavailableError(absl::StrCat("no engine: ", engine_info_.reason)),
                    clock_.Now());
    return true;
  }
  SnapshotPtr held = scene_->held();
  const size_t size = scene_->Plan(scene);
  Retire(std::move(held));
  const bool wanted = show_again_ || engine_is_new_ || last_submitted_ == 0 || round.has_value();
  if (size == 0 && !target_stale_ && !wanted) {
    KeepUnchanged(contents);
    return true;
  }

  Drawing& drawing = drawing_.emplace(Drawing{});
  drawing.began = clock_.Now();
  drawing.contents = contents;
  last_volume_ = round.has_value() ? round->volume : last_volume_ + 1;
  drawing.volume = last_volume_;
  drawing.lease = pool_.Acquire();
  if (target_stale_) {
    target_stale_ = false;
    target_ = CurrentTarget();
    target_steps_ = light_steps();
    ++targets_;
    made_.engine->SetTarget(target_, Completion(&FramePipeline::OnCallDone));
  }
  if (const absl::Status status = ApplyDelta(size); !status.ok()) {
    const sync::TimeNs began = drawing.began;
    if (round.has_value()) genlock_->Failed(member_, round->volume, status.ToString());
    drawing_.reset();
    OnEngineFailure(status, began);
    return true;
  }
  display::SliceFrame& frame = *drawing.lease.frame;
  made_.engine->SubmitFrame({drawing.volume, drawing.lease.holds}, {frame.bytes, frame.changed_in},
                            Completion(&FramePipeline::OnFrame));
  return true;
}

absl::Status FramePipeline::ApplyDelta(size_t size) {
  if (size == 0) return absl::OkStatus();
  absl::StatusOr<gpu::StagingBlock> block = made_.engine->AcquireStaging(size);
  if (!block.ok()) return block.status();
  gpu::DeltaWriter writer(block->bytes());
  scene_->Write(writer);
  if (writer.overrun() || writer.size() != size) {
    return absl::InternalError(
        absl::StrFormat("a delta planned as %d bytes came out as %d", size, writer.size()));
  }
  block->Refer(writer.TakeReferred());
  made_.engine->Apply(*std::move(block), size, Completion(&FramePipeline::OnCallDone));
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
  const absl::Status drawn = drawing.status.ok() ? result.status() : drawing.status;
  if (!drawn.ok()) {
    if (genlock_ != nullptr) genlock_->Failed(member_, drawing.volume, drawn.ToString());
    return OnEngineFailure(drawn, drawing.began);
  }

  lost_engine_ = false;
  refused_.clear();
  drawing.lease.frame->volume = drawing.volume;
  ++volumes_drawn_;
  lit_voxels_ = result->lit_voxels;
  SetEngineBytes(result->memory_bytes + scene_->memory_bytes(),
                 scene_->held() == nullptr ? 0 : scene_->held()->total.derived);
  singular_drawables_ = result->singular_drawables;
  const sync::TimeNs now = clock_.Now();
  draw_ns_ = std::max(now - drawing.began, draw_ns_ - draw_ns_ / 8);
  drawing.stages.drawing_ns = drawing.began;
  drawing.stages.sliced_ns = now;
  drawing.stages.assembled_ns = std::max(drawing.began, now - result->slice_ns - result->copy_ns);
  assemble_.Add(now, result->assemble_ns);
  slice_.Add(now, result->slice_ns);
  copy_.Add(now, result->copy_ns);
  packed_as_drawn_ = result->packed_as_drawn;
  if (care_ != nullptr && care_->away()) {
    care_->OnDrawn({scene_->held(), target_, drawing.lease.frame});
  } else if (care_ != nullptr) {
    care_->OnFrame();
  }

  if (!showing()) {
    riders_.LoseUnsubmitted(WhyNotShowing(), false);
    return ShowAgain(0);
  }
  if (genlock_ != nullptr && !IsOfRound(drawing.volume)) {  // the group has given it up
    return DrawAgain();
  }
  if (!Admit(drawing)) return;
  for (uint64_t& number : drawing.lease.frame->changed_in) number = std::max(number, first_volume_);
  const bool changed = std::exchange(engine_is_new_, false) || result->changed;
  if (!changed && !show_again_ && last_submitted_ != 0 && genlock_ == nullptr) {
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
  KeepScene(last_submitted_);
  riders_.Unchanged(last_submitted_);
  display_->ShowCurrent();
}

bool FramePipeline::HasNewer() const {
  if (genlock_ != nullptr) return true;  // what the others show, with the next round
  if (newest_ == nullptr) return false;
  return drawing_.has_value() || show_again_ || newest_->number != drawn_snapshot_ ||
         settings_changed_;
}

void FramePipeline::SubmitDrawn(Drawing drawing) {
  show_again_ = false;
  last_submitted_ = drawing.volume;
  in_display_[drawing.volume] = drawing.contents;
  KeepScene(drawing.volume);
  riders_.Submit(drawing.volume, drawing.stages);
  display_->Submit(std::move(drawing.lease.frame));
}

void FramePipeline::DrawAgain() {
  riders_.Redraw();
  if (pattern_ != TestPattern::kNone) riders_.HideWaiting();
  drawn_snapshot_.reset();
  ShowAgain(0);
}

void FramePipeline::ShowAgain(sync::TimeNs delay) {
  show_again_ = true;
  show_again_at_ = clock_.Now() + delay;
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
  if (outcome.kind == display::VolumeOutcome::Kind::kLost && outcome.volume == last_submitted_ &&
      !show_again_) {
    // A display that still shows sends what it lost again by itself; when it comes back it gets it
    // anew. What is to be drawn again sooner, since the engine failed, stays so.
    show_again_ = true;
    show_again_at_ = genlock_ == nullptr ? sync::kNever : clock_.Now();
  }
  if (genlock_ != nullptr && EndRound(outcome)) {
    riders_.Reboard(outcome.volume);
    if (pattern_ != TestPattern::kNone) riders_.HideWaiting();
    return;
  }
  riders_.OnOutcome(outcome);
}

void FramePipeline::OnState(display::DisplayState state, const std::string& reason) {
  if (state == display::DisplayState::kLost) link_.Lost(reason);
  if (state == display::DisplayState::kShowing || state == display::DisplayState::kBlanked) {
    link_.There(clock_.Now());
  }
  if (tell_state_) tell_state_(state, reason);
  if (genlock_ != nullptr) {
    const bool present = state == display::DisplayState::kShowing;
    genlock_->SetPresent(member_, present);
    if (present) ShowAgain(0);
  }
  if (state == display::DisplayState::kShowing) {
    FollowDevice();
    if (show_again_) show_again_at_ = std::min(show_again_at_, clock_.Now());
    return;
  }
  if (care_ != nullptr) care_->OnHidden();
  GiveUpAside();
  riders_.LoseUnsubmitted(WhyNotShowing(), true);
}

void FramePipeline::Told(const Rider& rider, const CommitOutcome& outcome) {
  if (outcome.kind == CommitOutcome::Kind::kPresented) {
    const sync::TimeNs now = clock_.Now();
    const Stages& at = outcome.stages;
    commit_to_presented_.Add(now, at.shown_ns - at.applied_ns);
    waiting_.Add(now, at.drawing_ns - at.applied_ns);
    if (at.transferred_ns != 0) {
      commit_to_last_byte_.Add(now, at.transferred_ns - at.applied_ns);
      transferring_.Add(now, at.transferred_ns - at.sliced_ns);
      showing_.Add(now, at.shown_ns - at.transferred_ns);
    }
  }
  tell_(rider, outcome);
}

}  // namespace voxeld::daemon
