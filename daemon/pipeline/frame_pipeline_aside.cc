// FramePipeline prepares large changes with a second engine, beside the engine that draws.
//
//   HoldBack   finds that an owner's change is large while other owners have layers. From then on the pipeline draws
//              that owner's layers and objects as they were before (WithPartsOf), and everything else as it is now.
//   a round    applies the newest snapshot to the second engine and has it draw a frame that is not shown. This runs on
//              the thread of `run_aside` and in the engine, so nothing here waits for it.
//   TakeAside  makes the second engine the one that draws. An ordinary delta brings what the others have changed in the
//              meantime. If that is a large change itself, another round comes first.
//
// A change is therefore shown whole, and each owner's commits are shown in order: the pipeline shows one snapshot's part of
// an owner who is held back, and the commits after it wait. The engine that drew until then is kept for a while as a
// spare: it lacks the same change, so the next large change costs what differs, not the whole scene.
#include <algorithm>
#include <memory>
#include <set>
#include <utility>

#include "daemon/pipeline/frame_pipeline.h"
#include "daemon/scene/scene_changes.h"
#include "gpu/delta.h"

namespace voxeld::daemon {
namespace {

constexpr sync::TimeNs kSpareLinger = 30 * sync::kSecond;
constexpr sync::TimeNs kAsideRetry = 10 * sync::kSecond;  // after a failure
// Each round applies what was changed during the previous one, so a few are enough.
constexpr int kMostRounds = 4;

// Returns whether clients keep a quarter of the budget's limit.
bool LeavesRoom(const Budget& budget, uint64_t more) {
  return budget.used_bytes() + more <= budget.limit_bytes() / 4 * 3;
}

}  // namespace

std::set<uint64_t> FramePipeline::HeldOwners() const {
  std::set<uint64_t> owners;
  for (const auto& [owner, number] : held_back_) owners.insert(owner);
  return owners;
}

uint64_t FramePipeline::WholeUpTo(uint64_t newest) const {
  for (const auto& [owner, number] : held_back_) newest = std::min(newest, number);
  return newest;
}

bool FramePipeline::MayHoldBack(const Snapshot& newest) const {
  if (genlock_ != nullptr || drawn_scene_ == nullptr || made_.engine == nullptr) return false;
  if (care_ != nullptr && (care_->away() || care_->has_pins())) return false;
  // There is nobody else to hold up.
  const bool alone = newest.owners.size() < 2 && drawn_scene_->owners.size() < 2;
  return !alone && clock_.Now() >= no_aside_until_;
}

SnapshotPtr FramePipeline::HoldBack(const SnapshotPtr& newest) {
  if (pattern_scene_ != nullptr) {
    GiveUpAside();
    Retire(std::exchange(drawn_scene_, nullptr));
    return pattern_scene_;
  }
  SnapshotPtr scene = newest;
  if (!MayHoldBack(*newest)) {
    GiveUpAside();
  } else {
    // A round under way has its owners; otherwise they are chosen here.
    const bool idle = aside_ == nullptr || aside_->phase == Aside::Phase::kSpare;
    const auto changes = ChangesByOwner(*drawn_scene_, *newest, large_change_,
                                        idle ? std::set<uint64_t>() : HeldOwners());
    const auto is_large = [&](uint64_t owner) {
      const auto change = changes.find(owner);
      return change != changes.end() && change->second >= large_change_;
    };
    if (idle) std::erase_if(held_back_, [&](const auto& held) { return !is_large(held.first); });
    for (const auto& [owner, change] : changes) {
      if (is_large(owner)) held_back_.emplace(owner, drawn_number_);
    }
    if (idle && !held_back_.empty() && !BeginAside(newest)) held_back_.clear();
    if (!held_back_.empty()) scene = WithPartsOf(*newest, *drawn_scene_, HeldOwners());
  }
  Retire(std::exchange(drawn_scene_, scene));
  drawn_number_ = newest->number;
  return scene;
}

bool FramePipeline::BeginAside(const SnapshotPtr& newest) {
  // The measured size is charged when a round ends. The expected size is an upper bound that is seldom reached.
  const uint64_t expected = std::max(aside_bytes_, newest->total.derived);
  if (budget_ != nullptr && !LeavesRoom(*budget_, expected - aside_bytes_)) {
    DropAside();
    return false;
  }
  if (aside_ == nullptr) {
    gpu::EngineOptions options = engine_options_;
    options.kind = engine_info_.kind;
    options.wait_until_ready = false;
    absl::StatusOr<EngineCare::Made> made = Make(options);
    if (!made.ok()) {
      no_aside_until_ = clock_.Now() + kAsideRetry;
      return false;
    }
    aside_ = std::make_shared<Aside>();
    aside_->made = *std::move(made);
    aside_->scene = std::make_unique<EngineScene>();
    aside_->bytes.resize(info().layout.bytes());
    aside_->changed_in.resize(info().layout.pictures());
    aside_->target = CurrentTarget();
  } else if (aside_->targets != targets_ || target_stale_) {
    aside_->target = CurrentTarget();
  }
  // The engine that draws receives a stale target with the volume that is about to be drawn.
  aside_->targets = targets_ + (target_stale_ ? 1 : 0);
  aside_->owners = HeldOwners();
  aside_->number = newest->number;
  aside_->rounds = 0;
  aside_->goal = newest;
  BeginRound();
  return true;
}

void FramePipeline::BeginRound() {
  ++aside_->rounds;
  aside_->phase = Aside::Phase::kUnderWay;
  aside_->status = absl::OkStatus();
  aside_->frame = ++last_volume_;
  aside_alive_ = std::make_shared<bool>(true);
  aside_->called = AsideCompletion(&FramePipeline::OnAsideCall);
  aside_->drawn = AsideCompletion(&FramePipeline::OnAsideFrame);
  // Until the frame is drawn, only this work and the engine use what they are given.
  auto work = [aside = aside_, alive = std::weak_ptr<bool>(aside_alive_)] {
    if (alive.expired()) return;
    gpu::Engine& engine = *aside->made.engine;
    if (aside->target.has_value()) {
      engine.SetTarget(*std::exchange(aside->target, {}), aside->called);
    }
    const size_t size = aside->scene->Plan(aside->goal);
    if (alive.expired()) return;
    if (size > 0) {
      absl::StatusOr<gpu::StagingBlock> block = engine.AcquireStaging(size);
      if (!block.ok()) return aside->drawn(block.status());
      gpu::DeltaWriter writer(block->bytes());
      aside->scene->Write(writer);
      block->Refer(writer.TakeReferred());
      engine.Apply(*std::move(block), size, aside->called);
    }
    engine.SubmitFrame({.frame = aside->frame}, {aside->bytes, aside->changed_in}, aside->drawn);
  };
  if (run_aside_) {
    run_aside_(std::move(work));
  } else {
    work();
  }
}

template <typename Result>
std::function<void(Result)> FramePipeline::AsideCompletion(
    void (FramePipeline::*method)(const Result&)) {
  return [this, method, work = work_, alive = std::weak_ptr<bool>(aside_alive_)](Result result) {
    work->Post([this, method, alive, result = std::move(result)] {
      if (alive.lock() != nullptr) (this->*method)(result);
    });
  };
}

void FramePipeline::OnAsideCall(const absl::Status& status) { aside_->status.Update(status); }

void FramePipeline::OnAsideFrame(const absl::StatusOr<gpu::FrameResult>& result) {
  aside_alive_ = nullptr;
  aside_->status.Update(result.status());
  if (!aside_->status.ok()) return GiveUpAside();
  SetAsideBytes(result->memory_bytes + aside_->scene->memory_bytes());
  aside_->phase = Aside::Phase::kReady;
}

bool FramePipeline::TakeAside() {
  if (!MayHoldBack(*newest_)) {
    GiveUpAside();
    return true;
  }
  const std::set<uint64_t> held = HeldOwners();
  const SnapshotPtr others = WithPartsOf(*newest_, *drawn_scene_, held);
  const SnapshotPtr next = WithPartsOf(*others, *aside_->goal, aside_->owners);
  uint64_t behind = 0;
  for (const auto& [owner, change] : ChangesByOwner(*aside_->goal, *next, large_change_)) {
    behind += change;
  }
  if (behind >= large_change_ && aside_->rounds < kMostRounds) {
    Retire(std::exchange(aside_->goal, next));
    BeginRound();
    return false;
  }

  Retire(std::exchange(drawn_scene_, WithPartsOf(*drawn_scene_, *aside_->goal, aside_->owners)));
  for (const uint64_t owner : aside_->owners) held_back_[owner] = aside_->number;
  Retire(std::exchange(aside_->goal, nullptr));
  std::swap(made_, aside_->made);
  std::swap(scene_, aside_->scene);
  scene_->SetBreathe([this] { Breathe(); });
  aside_->scene->SetBreathe(nullptr);
  if (aside_->targets != targets_) target_stale_ = true;
  aside_->targets = targets_;
  std::swap(engine_bytes_, aside_bytes_);
  engine_info_ = made_.engine->info();
  engine_info_.reason = reason_;
  // No display has seen what it drew so far: all buffers are new to it, and all of its pictures to the display.
  pool_.Forget(last_volume_);
  first_volume_ = last_volume_ + 1;
  engine_is_new_ = true;
  aside_->phase = Aside::Phase::kSpare;
  aside_->until = clock_.Now() + kSpareLinger;
  return true;
}

void FramePipeline::GiveUpAside() {
  const bool failed = aside_ != nullptr && !aside_->status.ok();
  if (failed) no_aside_until_ = clock_.Now() + kAsideRetry;
  DropAside();
  if (held_back_.empty()) return;
  // The next volume is drawn from the newest snapshot, whatever that changes.
  held_back_.clear();
  drawn_snapshot_.reset();
  Retire(std::exchange(drawn_scene_, nullptr));
}

void FramePipeline::DropAside() {
  aside_alive_ = nullptr;
  Retire(std::exchange(aside_, nullptr));
  SetAsideBytes(0);
}

void FramePipeline::SetAsideBytes(uint64_t bytes) {
  if (budget_ == nullptr) return;
  if (bytes > aside_bytes_) budget_->ChargeAnyway(Budget::Use::kEngines, bytes - aside_bytes_);
  if (bytes < aside_bytes_) budget_->Release(Budget::Use::kEngines, aside_bytes_ - bytes);
  aside_bytes_ = bytes;
}

sync::TimeNs FramePipeline::ReleaseSpare() {
  if (aside_ == nullptr || aside_->phase != Aside::Phase::kSpare) return sync::kNever;
  const bool room = budget_ == nullptr || LeavesRoom(*budget_, 0);
  if (room && clock_.Now() < aside_->until) return aside_->until;
  DropAside();
  return sync::kNever;
}

}  // namespace voxeld::daemon
