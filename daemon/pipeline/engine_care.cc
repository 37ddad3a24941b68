#include "daemon/pipeline/engine_care.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/delta.h"
#include "gpu/ranks/ranked_engine.h"
#include "gpu/worker/worker_engine.h"

namespace voxeld::daemon {
namespace {

constexpr sync::TimeNs kFirstPause = sync::kSecond / 4;
constexpr sync::TimeNs kLongestPause = 60 * sync::kSecond;
// An engine that came back and has drawn this many frames is well again: pauses begin anew.
constexpr uint64_t kWellFrames = 50;
// From when on the last volume counts as held.
constexpr sync::TimeNs kHolding = sync::kSecond / 4;
constexpr size_t kMostPins = 16;
constexpr size_t kBytesPerBreath = size_t{4} << 20;
constexpr uint64_t kEverything = UINT64_MAX;

std::string NameOf(const EntityPlace& place) {
  return absl::StrCat("entity \"", place.id, "\" of layer \"", place.layer.name, "\" of owner ",
                      place.layer.owner);
}

}  // namespace

const char* EngineEventName(EngineEvent::What what) {
  switch (what) {
    case EngineEvent::What::kLost:
      return "engine lost, the CPU takes over";
    case EngineEvent::What::kHolding:
      return "the last volume is held";
    case EngineEvent::What::kTookOver:
      return "the CPU has taken over";
    case EngineEvent::What::kNotHeld:
      return "no volume is held: the display does not show";
    case EngineEvent::What::kFaulted:
      return "engine faulted again";
    case EngineEvent::What::kPinned:
      return "entity pinned to the CPU";
    case EngineEvent::What::kAway:
      return "engine stays away";
    case EngineEvent::What::kReturned:
      return "engine is back";
  }
  return "unknown";
}

EngineCare::EngineCare(Options options)
    : options_(std::move(options)), clock_(*options_.clock), pause_(kFirstPause) {}

EngineCare::~EngineCare() { Stop(); }

void EngineCare::Stop() {
  alive_ = nullptr;
  attempt_ = nullptr;
  search_.reset();
  drawn_.reset();
  phase_ = Phase::kThere;
}

void EngineCare::Tell(EngineEvent::What what, std::string text, sync::TimeNs took) const {
  if (options_.tell) options_.tell({"", what, std::move(text), took});
}

void EngineCare::Keep(std::optional<Drawn> drawn) {
  if (drawn_.has_value()) Retire(std::move(drawn_->scene));
  drawn_ = std::move(drawn);
}

void EngineCare::Retire(std::shared_ptr<const void> what) const {
  if (what != nullptr && options_.retire) options_.retire(std::move(what));
}

// ------------------------------------------------------------------------ what the pipeline tells

void EngineCare::OnLost(const absl::Status& why, sync::TimeNs since) {
  const sync::TimeNs now = clock_.Now();
  ++(absl::IsDataLoss(why) ? faults_ : out_of_memory_);
  if (frames_since_return_ >= kWellFrames) pause_ = kFirstPause;
  why_ = std::string(why.message());
  away_because_.clear();
  lost_at_ = now;
  holding_since_ = since;
  holding_told_ = false;
  search_.reset();
  whole_passed_ = false;
  phase_ = Phase::kWaiting;
  next_try_ = now + pause_;
  pause_ = std::min(2 * pause_, kLongestPause);
  Tell(EngineEvent::What::kLost, why_);
}

void EngineCare::OnEngineLost(uint64_t id, const absl::Status& why) {
  if (!ready() || attempt_->made.id != id) return;
  Retire(std::move(attempt_));
  whole_passed_ = false;
  StayAway(std::string(why.message()));
}

void EngineCare::OnHidden() {
  if (holding_since_.has_value() && holding_told_) Tell(EngineEvent::What::kNotHeld, why_);
  holding_since_.reset();
}

void EngineCare::OnFrame() { ++frames_since_return_; }

void EngineCare::OnDrawn(Drawn drawn) {
  if (!away()) return;
  Keep(std::move(drawn));
  if (!holding_since_.has_value()) return;
  takeover_last_ns_ = clock_.Now() - *holding_since_;
  takeover_max_ns_ = std::max(takeover_max_ns_, takeover_last_ns_);
  redraw_last_ns_ = clock_.Now() - lost_at_;
  redraw_max_ns_ = std::max(redraw_max_ns_, redraw_last_ns_);
  holding_since_.reset();
  Tell(EngineEvent::What::kTookOver, why_, takeover_last_ns_);
}

sync::TimeNs EngineCare::Step() {
  const sync::TimeNs now = clock_.Now();
  sync::TimeNs next = sync::kNever;
  if (holding_since_.has_value() && !holding_told_) {
    if (now >= *holding_since_ + kHolding) {
      holding_told_ = true;
      Tell(EngineEvent::What::kHolding, why_);
    } else {
      next = *holding_since_ + kHolding;
    }
  }
  if (phase_ != Phase::kWaiting || !drawn_.has_value()) return next;
  if (now < next_try_) return std::min(next, next_try_);
  if (search_.has_value()) {
    SearchOn();
  } else {
    Try(whole_passed_ ? Test::kShared : Test::kWhole, *drawn_, 0);
  }
  return next;
}

EngineCare::Returned EngineCare::Take() {
  Returned returned{std::move(attempt_->made), std::move(attempt_->scene)};
  Retire(std::move(attempt_));
  Keep(std::nullopt);
  phase_ = Phase::kThere;
  frames_since_return_ = 0;
  ++returns_;
  return_last_ns_ = clock_.Now() - lost_at_;
  return_max_ns_ = std::max(return_max_ns_, return_last_ns_);
  Tell(EngineEvent::What::kReturned, why_, return_last_ns_);
  return returned;
}

// ----------------------------------------------------------------------------------- attempts

void EngineCare::Try(Test test, Drawn drawn, uint64_t left_out) {
  phase_ = Phase::kTrying;
  attempt_ = std::make_shared<Attempt>();
  attempt_->test = test;
  attempt_->drawn = std::move(drawn);
  attempt_->seen = std::make_shared<Seen>();
  attempt_->seen->left_out = left_out;
  alive_ = std::make_shared<bool>(true);
  if (const absl::Status status = Begin(*attempt_); !status.ok()) {
    alive_ = nullptr;
    Retire(std::move(attempt_));
    return StayAway(std::string(status.message()));
  }
  // What was to blame is not in this scene.
  if (test == Test::kWhole) {
    std::erase_if(pins_, [](const Pin& pin) { return !pin.place.has_value(); });
  }
}

absl::Status EngineCare::Begin(Attempt& attempt) {
  gpu::EngineOptions options = options_.engine;
  options.wait_until_ready = false;
  if (attempt.test != Test::kShared) options.workers = nullptr;
  absl::StatusOr<Made> made = options_.make_engine(options);
  if (!made.ok()) return made.status();
  attempt.made = *std::move(made);
  attempt.scene = std::make_unique<EngineScene>(options_.breathe, Chooser(attempt.seen));
  gpu::Engine& engine = *attempt.made.engine;
  engine.SetTarget(attempt.drawn.target, Completion(&EngineCare::OnCall));
  const size_t size = attempt.scene->Plan(attempt.drawn.scene);
  absl::StatusOr<gpu::StagingBlock> block = engine.AcquireStaging(size);
  if (!block.ok()) return block.status();
  gpu::DeltaWriter writer(block->bytes());
  attempt.scene->Write(writer);
  block->Refer(writer.TakeReferred());
  engine.Apply(*std::move(block), size, Completion(&EngineCare::OnCall));
  const size_t bytes = attempt.drawn.frame->bytes.size();
  attempt.bytes = std::make_unique_for_overwrite<std::byte[]>(bytes);
  attempt.changed_in.resize(attempt.drawn.frame->changed_in.size());
  engine.SubmitFrame({.frame = 1}, {{attempt.bytes.get(), bytes}, attempt.changed_in},
                     Completion(&EngineCare::OnResult));
  return absl::OkStatus();
}

template <typename Result>
std::function<void(Result)> EngineCare::Completion(void (EngineCare::*method)(const Result&)) {
  return [this, method, work = options_.work, alive = std::weak_ptr<bool>(alive_)](Result result) {
    work->Post([this, method, alive, result = std::move(result)] {
      if (alive.lock() != nullptr) (this->*method)(result);
    });
  };
}

bool EngineCare::SameBytes(const Attempt& attempt) const {
  const std::vector<std::byte>& want = attempt.drawn.frame->bytes;
  for (size_t at = 0; at < want.size(); at += kBytesPerBreath) {
    const size_t size = std::min(kBytesPerBreath, want.size() - at);
    if (std::memcmp(attempt.bytes.get() + at, want.data() + at, size) != 0) return false;
    if (options_.breathe) options_.breathe();
  }
  return true;
}

void EngineCare::OnCall(const absl::Status& status) {
  if (status.ok()) attempt_->there = true;
  if (attempt_->status.ok()) attempt_->status = status;
}

void EngineCare::OnResult(const absl::StatusOr<gpu::FrameResult>& result) {
  alive_ = nullptr;
  const std::shared_ptr<Attempt> attempt = std::exchange(attempt_, nullptr);
  Retire(attempt);
  const absl::Status status = attempt->status.ok() ? result.status() : attempt->status;
  const bool excused = gpu::IsLate(status) || gpu::IsOutOfMemory(status);
  if (absl::IsDataLoss(status) && attempt->there && !excused) {
    return OnFault(*attempt, status);
  }
  if (!status.ok()) return StayAway(std::string(status.message()));
  if (attempt->test == Test::kSearch) {
    const Seen& seen = *attempt->seen;
    if (search_->well == search_->faults + 1 && search_->nothing_is_well) {
      search_.reset();
      return StayAway("the scene faulted, but does so no more");
    }
    search_->well = seen.below;
    if (!std::exchange(search_->nothing_is_well, true)) search_->faults = seen.least - 1;
    return SearchOn();
  }
  if (!SameBytes(*attempt)) {
    ++mismatches_;
    return StayAway("it draws other bytes than the CPU does");
  }
  if (attempt->test == Test::kWhole && options_.engine.workers != nullptr) {
    whole_passed_ = true;
    return Try(Test::kShared, attempt->drawn, 0);
  }
  attempt_ = attempt;
  phase_ = Phase::kReady;
}

void EngineCare::OnFault(const Attempt& attempt, const absl::Status& why) {
  ++faults_;
  Tell(EngineEvent::What::kFaulted, std::string(why.message()));
  switch (attempt.test) {
    case Test::kShared:
      // Others use that process too: it says nothing about this scene.
      whole_passed_ = false;
      return StayAway(std::string(why.message()));
    case Test::kWhole:
      search_ = Search{attempt.drawn};
      return SearchOn();
    case Test::kSearch:
      break;
  }
  if (!search_->nothing_is_well) {
    search_.reset();
    pause_ = kLongestPause;
    return StayAway(absl::StrCat("the GPU faults even when it draws nothing: ", why.message()));
  }
  search_->fault_seen = true;
  search_->faults = attempt.seen->above - 1;
  SearchOn();
}

void EngineCare::SearchOn() {
  const Search& search = *search_;
  if (!search.nothing_is_well) return Try(Test::kSearch, search.drawn, kEverything);
  if (search.well > search.faults + 1) {
    return Try(Test::kSearch, search.drawn, search.faults + (search.well - search.faults) / 2);
  }
  const bool found = search.well == search.faults + 1;
  // That the scene faults with it may still be hearsay.
  if (found && !search.fault_seen) return Try(Test::kSearch, search.drawn, search.faults);
  Drawn drawn = std::move(search_->drawn);
  const uint64_t number = search.well;
  search_.reset();
  if (!found) return StayAway("the scene faults, but no single entity of it does");
  if (pins_.size() == kMostPins) {
    pause_ = kLongestPause;
    return StayAway(absl::StrCat("more than ", kMostPins, " entities fault"));
  }
  pins_.push_back({number, std::nullopt});
  Try(Test::kWhole, std::move(drawn), 0);
}

void EngineCare::StayAway(const std::string& why) {
  phase_ = Phase::kWaiting;
  next_try_ = clock_.Now() + pause_;
  pause_ = std::min(2 * pause_, kLongestPause);
  away_because_ = why;
  Tell(EngineEvent::What::kAway, why);
}

// --------------------------------------------------------------------------------------- pins

EngineScene::Choose EngineCare::Chooser(std::shared_ptr<Seen> seen) {
  return [this, seen = std::move(seen)](const OwnedName& layer, const std::string& id,
                                        const Entity& entity) {
    for (Pin& pin : pins_) {
      const bool same = entity.number == pin.number ||
                        (pin.place.has_value() && pin.place->id == id && pin.place->layer == layer);
      if (!same) continue;
      if (!pin.place.has_value()) {
        pin.place = EntityPlace{layer, id};
        Tell(EngineEvent::What::kPinned, NameOf(*pin.place));
      }
      return DrawnWhere::kCpu;
    }
    if (seen == nullptr) return DrawnWhere::kEngine;
    seen->least = std::min(seen->least, entity.number);
    if (entity.number <= seen->left_out) {
      seen->below = std::max(seen->below, entity.number);
      return DrawnWhere::kNowhere;
    }
    seen->above = std::min(seen->above, entity.number);
    return DrawnWhere::kEngine;
  };
}

void EngineCare::Prune(const Snapshot& newest, const Snapshot* pattern) {
  std::erase_if(pins_, [&](const Pin& pin) {
    if (!pin.place.has_value()) return false;
    const auto [layer, id] = *pin.place;
    return newest.FindEntity(layer, id) == nullptr &&
           (pattern == nullptr || pattern->FindEntity(layer, id) == nullptr);
  });
}

// ------------------------------------------------------------------------------------ figures

void EngineCare::AddTo(DisplayFigures& figures) const {
  if (away()) {
    figures.engine_degraded = away_because_.empty() || phase_ != Phase::kWaiting
                                  ? why_
                                  : absl::StrCat(why_, "; ", away_because_);
  } else if (!pins_.empty()) {
    figures.engine_degraded = "entities that made the GPU fault are drawn by the CPU";
  }
  figures.volume_held = holding_told_ && holding_since_.has_value();
  figures.engine_faults = faults_;
  figures.engine_out_of_memory = out_of_memory_;
  figures.engine_returns = returns_;
  figures.engine_mismatches = mismatches_;
  figures.takeover_last_ns = takeover_last_ns_;
  figures.takeover_max_ns = takeover_max_ns_;
  figures.redraw_last_ns = redraw_last_ns_;
  figures.redraw_max_ns = redraw_max_ns_;
  figures.return_last_ns = return_last_ns_;
  figures.return_max_ns = return_max_ns_;
  for (const Pin& pin : pins_) {
    if (pin.place.has_value()) figures.pinned_entities.push_back(NameOf(*pin.place));
  }
}

}  // namespace voxeld::daemon
