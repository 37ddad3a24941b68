// FramePipeline and its engine: made, lost, replaced, and come back.
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/pipeline/frame_pipeline.h"

namespace voxeld::daemon {
namespace {

// After a failure of the engine, without a new commit.
constexpr sync::TimeNs kEngineRetryDelay = sync::kSecond;

}  // namespace

absl::Status FramePipeline::Open(std::function<void(EngineEvent)> tell) {
  absl::StatusOr<EngineCare::Made> made = Make(engine_options_);
  if (!made.ok()) return made.status();
  made_ = *std::move(made);
  engine_info_ = made_.engine->info();
  reason_ = engine_info_.reason;
  if (engine_info_.kind == gpu::EngineKind::kCpu && !engine_options_.in_worker) {
    return absl::OkStatus();
  }
  EngineCare::Options care;
  care.make_engine = [this](const gpu::EngineOptions& options) { return Make(options); };
  care.engine = engine_options_;
  care.engine.kind = engine_info_.kind;
  care.work = work_;
  care.clock = &clock_;
  care.breathe = [this] { Breathe(); };
  care.retire = [this](std::shared_ptr<const void> what) { Retire(std::move(what)); };
  care.tell = std::move(tell);
  care_ = std::make_unique<EngineCare>(std::move(care));
  return absl::OkStatus();
}

absl::StatusOr<EngineCare::Made> FramePipeline::Make(gpu::EngineOptions options) {
  const uint64_t id = ++engines_made_;
  options.lost = [this, id, work = work_,
                  alive = std::weak_ptr<bool>(alive_)](const absl::Status& status) {
    work->Post([this, id, alive, status] {
      if (alive.lock() != nullptr) OnEngineLost(id, status);
    });
  };
  absl::StatusOr<std::unique_ptr<gpu::Engine>> engine = make_engine_(options);
  if (!engine.ok()) return engine.status();
  return EngineCare::Made{*std::move(engine), id};
}

bool FramePipeline::HaveEngine() {
  if (made_.engine != nullptr) return true;
  gpu::EngineOptions options = engine_options_;
  options.kind = gpu::EngineKind::kCpu;
  options.in_worker = false;
  absl::StatusOr<EngineCare::Made> made = Make(options);
  if (!made.ok()) {
    engine_info_.reason = std::string(made.status().message());
    return false;
  }
  made_ = *std::move(made);
  engine_info_ = made_.engine->info();
  if (!takeover_.empty()) engine_info_.reason = takeover_;
  return true;
}

void FramePipeline::TakeReturned() {
  Retire(std::shared_ptr<gpu::Engine>(std::move(made_.engine)));
  Retire(std::shared_ptr<EngineScene>(std::move(scene_)));
  EngineCare::Returned returned = care_->Take();
  made_ = std::move(returned.made);
  scene_ = std::move(returned.scene);
  engine_info_ = made_.engine->info();
  engine_info_.reason = reason_;
  takeover_.clear();
  // What it has drawn so far no display has seen: buffers are new to it, and its pictures to the
  // display.
  target_stale_ = true;
  pool_.Forget(last_volume_);
  first_volume_ = last_volume_ + 1;
  engine_is_new_ = true;
}

void FramePipeline::SetEngineBytes(uint64_t bytes, uint64_t derived) {
  if (budget_ == nullptr) return;
  using Use = Budget::Use;
  // A scene that grows is not counted twice meanwhile, as expected and as measured.
  if (derived > derived_bytes_) {
    budget_->ReplaceDerived(std::exchange(derived_bytes_, derived), derived);
  }
  if (bytes > engine_bytes_) budget_->ChargeAnyway(Use::kEngines, bytes - engine_bytes_);
  if (bytes < engine_bytes_) budget_->Release(Use::kEngines, engine_bytes_ - bytes);
  engine_bytes_ = bytes;
  budget_->ReplaceDerived(std::exchange(derived_bytes_, derived), derived);
}

void FramePipeline::OnEngineLost(uint64_t id, const absl::Status& status) {
  // A call under way has told it already, and there is another engine.
  if (id == made_.id && made_.engine != nullptr && !drawing_.has_value()) {
    OnEngineFailure(status, clock_.Now());
  } else if (aside_ != nullptr && id == aside_->made.id) {
    OnAsideCall(status);
    GiveUpAside();
  } else if (care_ != nullptr) {
    care_->OnEngineLost(id, status);
  }
}

void FramePipeline::OnEngineFailure(const absl::Status& status, sync::TimeNs since) {
  Retire(std::shared_ptr<EngineScene>(std::move(scene_)));
  scene_ = std::make_unique<EngineScene>([this] { Breathe(); });
  target_stale_ = true;
  GiveUpAside();
  // A device that has no memory for the scene gives way too.
  const bool gives_way = absl::IsResourceExhausted(status) && care_ != nullptr && !care_->away();
  if (absl::IsDataLoss(status) || gives_way) {
    Retire(std::shared_ptr<gpu::Engine>(std::move(made_.engine)));
    pool_.Forget(last_volume_);
    if (care_ != nullptr && !care_->away()) care_->OnLost(status, since);
    if (care_ != nullptr && !showing()) care_->OnHidden();
    // Whatever it was, the next is on the CPU, in this process: made at once, with the same bytes.
    takeover_ = absl::StrCat("took over from ", gpu::EngineKindName(engine_info_.kind), ": ",
                             status.message());
    if (!std::exchange(lost_engine_, true) && HaveEngine() && showing()) {
      return DrawAgain();
    }
  }
  refused_ = std::string(status.message());
  riders_.LoseUnsubmitted(absl::StrCat("the engine failed: ", status.ToString()), false);
  if (genlock_ == nullptr) display_->ShowCurrent();
  ShowAgain(kEngineRetryDelay);
}

}  // namespace voxeld::daemon
