#include "tests/simulation/simulation_run.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/engine_picture.h"

namespace voxeld::simulation {
namespace {

using daemon::model::PlainScene;
using sync::kMillisecond;
using sync::kSecond;

// How long after a disturbance a display may still lose something because of it: its device is
// asked four times, half a second each, before it is given up.
constexpr sync::TimeNs kAftermath = 6 * kSecond;
// A device's reports about its clock are believed for two windows of 5 s.
constexpr sync::TimeNs kLieAftermath = 15 * kSecond;
// The same, after an engine failure.
constexpr sync::TimeNs kEngineAftermath = 2 * kSecond;
// How far the times that a device reports may be off.
constexpr sync::TimeNs kTolerance = 2 * kMillisecond;

std::vector<std::string> NamesOf(const Scenario& scenario) {
  std::vector<std::string> names;
  for (const SeatOptions& seat : scenario.seats) names.push_back(seat.name);
  return names;
}

std::vector<OutcomeJudge::Screen> ScreensOf(const Scenario& scenario,
                                            const std::vector<Look>& black) {
  std::vector<OutcomeJudge::Screen> screens;
  for (const SeatOptions& seat : scenario.seats) {
    screens.push_back(
        {.name = seat.name, .eye = Eye(black[screens.size()]), .tolerance = kTolerance});
  }
  return screens;
}

std::vector<Look> BlackOf(const std::vector<Seat>& seats) {
  std::vector<Look> looks;
  for (const Seat& seat : seats) {
    looks.push_back(LookOf(std::vector<std::byte>(seat.display->info().layout.bytes())));
  }
  return looks;
}

uint64_t HashOf(const std::string& text) { return std::hash<std::string>()(text); }

}  // namespace

SimulationRun::SimulationRun(const Scenario& scenario, std::ostream* trace)
    : CoreJudge(scenario.limits, NamesOf(scenario), trace),
      scenario_(scenario),
      judge_({}),
      now_(scenario.seats.size()) {
  World::Hooks hooks;
  hooks.before_pipeline = [this](size_t d) { BeforePipeline(d); };
  hooks.after_pipeline = [this](size_t d) { AfterPipeline(d); };
  hooks.after_device = [this](size_t d) { AfterDevice(d); };
  world_.emplace(scenario.seed, scenario.limits, scenario.seats, std::move(hooks));
  if (!world_->status().ok()) return;
  plain_.keeps_state = true;
  judge_ = OutcomeJudge(ScreensOf(scenario, BlackOf(world_->seats())));
  for (size_t d = 0; d < now_.size(); ++d) {
    const Seat& seat = world_->seats()[d];
    EngineStage& engine = *seat.engine;
    engine.on_submit = [this, d](uint64_t volume) { OnSubmit(d, volume); };
    engine.on_failed = [this, d](uint64_t volume, const absl::Status& status) {
      OnEngineFailed(d, volume, status);
    };
    engine.on_frame = [this, d](uint64_t volume, const daemon::testing::SceneModel& scene,
                                std::span<const std::byte> bytes) {
      OnFrame(d, volume, scene, bytes);
    };
    engine.takes = [this]() -> sync::TimeNs {
      Chance& chance = world_->chance();
      if (now() < slow_engines_until_) return chance.Pick(80) * kMillisecond;
      return chance.OneIn(2) ? 0 : chance.Pick(2000) * sync::TimeNs{1000};
    };
    // A timed commit is applied for the sweep before its time, as far as the sweeps are known.
    const auto period =
        static_cast<sync::TimeNs>(kSecond / seat.display->info().volumes_per_second);
    plain_.early = std::max(plain_.early, period * 3 / 2 + kMillisecond);
    plain_.slack = kMillisecond + 1;
  }
}

SimulationRun::~SimulationRun() {
  Over();
  world_.reset();
}

std::string SimulationRun::Run() {
  if (!world_->status().ok()) return std::string(world_->status().message());
  started_ns_ = now();
  RunScenario();
  tally_.time_ns = now() - started_ns_;
  return wrong_;
}

Tally SimulationRun::tally() const {
  Tally tally = tally_;
  tally.turns = world_->turns();
  tally.commits = judge_.commits();
  tally.outcomes = judge_.told();
  tally.kinds = judge_.kinds();
  return tally;
}

void SimulationRun::RunToRest() {
  if (world_->RunToRest()) return;
  Fail(absl::StrCat("turn after turn, and time stands still: ", world_->Busy()));
}

daemon::model::RandomMessage SimulationRun::Compose(Chance& chance, uint64_t last_sequence,
                                                    uint64_t* next_frame_id) {
  daemon::model::RandomMessage message =
      daemon::model::MakeMessage(chance, last_sequence, next_frame_id, now(), SmallPalette());
  for (daemon::Operation& operation : message.operations) {
    auto* commit = std::get_if<daemon::Commit>(&operation.op);
    if (commit == nullptr) continue;
    // Nothing is known about the clocks of clients: they jump.
    switch (chance.Pick(6)) {
      case 0:
        commit->send_time_ns = now() + static_cast<int64_t>(chance.Next()) * 1000 - kSecond;
        break;
      case 1:
        commit->send_time_ns = chance.OneIn(2) ? INT64_MAX : INT64_MIN;
        break;
      case 2:
        break;
      default:
        commit->send_time_ns = now() + 3600 * kSecond;
    }
    // With a device that lies about its sweeps, timed commits are applied at any time.
    if (scenario_.lies) commit->present_at_ns = 0;
    commit->durable = chance.OneIn(6);
  }
  return message;
}

// -------------------------------------------------------------------------------- reports

void SimulationRun::OnApplied(const Applied& commit) { judge_.OnApplied(commit, now()); }

void SimulationRun::OnPictured(uint64_t snapshot) {
  const PlainScene::Picture picture = plain_.scene.Draw();
  Pictured& kept = pictured_[snapshot];
  kept.seen = HashOf(picture.seen);
  kept.whole = HashOf(picture.shown) * 31 + HashOf(picture.hidden);
  judge_.Pictured(snapshot, kept.seen);
  changed_ns_ = now();
}

std::string SimulationRun::OnTold(uint64_t session, const daemon::Receipt& receipt,
                                  const CommitOutcome& outcome) {
  for (size_t d = 0; d < now_.size(); ++d) NoteDisturbances(d);
  // A packet that was damaged on a cable is sent again, and damaging it again takes another fault
  // each time.
  if (outcome.reason.find("did not arrive") != std::string::npos && !scenario_.lies &&
      tally_.faults < display::voxlink::kMaxResends && !scenario_.transport_faults) {
    return absl::StrCat("LOST after ", tally_.faults, " faults: ", outcome.reason);
  }
  return judge_.Told(session, receipt, outcome, now());
}

// ---------------------------------------------------------------------------- disturbances

void SimulationRun::Disturb(size_t d, sync::TimeNs until) {
  const std::vector<Seat>& seats = world_->seats();
  for (size_t other = 0; other < seats.size(); ++other) {
    const bool together = !seats[d].genlock.empty() && seats[other].genlock == seats[d].genlock;
    if (other == d || together) judge_.Disturb(other, until);
  }
}

void SimulationRun::NoteDisturbances(size_t d) {
  const Seat& seat = world_->seats()[d];
  DisplayNow& is = now_[d];
  const bool pending = seat.faults->faults_left() > 0 || seat.engine->fail_staging ||
                       seat.engine->fail.has_value() || !is.plugged;
  if (std::exchange(is.faults_pending, pending) || pending) Disturb(d, now() + kAftermath);
  if (std::exchange(is.transport_hits, seat.cable->hits()) != seat.cable->hits()) {
    Disturb(d, now() + kAftermath);
  }
  if (is.lies) {
    Disturb(d, now() + kLieAftermath);
    judge_.screen(d).lied_until = now() + kLieAftermath;
  }
  const display::DisplayState state = seat.display->state();
  if (state != display::DisplayState::kShowing && state != display::DisplayState::kBlanked) {
    Disturb(d, now() + kAftermath);
  }
}

void SimulationRun::BeforePipeline(size_t d) {
  if (!wrong_.empty()) return;
  Explain(UINT64_MAX);
  NoteDisturbances(d);
  judge_.Boards(d, world_->seats()[d].display->state());
}

void SimulationRun::AfterPipeline(size_t d) {
  if (!wrong_.empty()) return;
  NoteDisturbances(d);
  judge_.Boarded(d, world_->seats()[d].display->state());
}

// ---------------------------------------------------------------------------- what is visible

void SimulationRun::AfterDevice(size_t d) {
  if (!wrong_.empty()) return;
  NoteDisturbances(d);
  DisplayNow& is = now_[d];
  const Seat& seat = world_->seats()[d];
  display::voxlink::VolumePtr shown;
  uint64_t excess = 0;
  seat.carrier->WithDevice([&](display::UsbDeviceModel&) {
    shown = seat.device->screen().shown();
    excess = seat.device->credit_excess();
  });
  if (excess != 0) return Fail(absl::StrCat("display ", d, " was sent more than it has room for"));
  if (shown == is.shown) return;
  is.shown = shown;
  if (shown == nullptr) return;
  const Look look = LookOf(shown->pictures);
  Trace(absl::StrCat("    display ", d, " shows ", look));
  // Time goes from sweep to sweep: this one begins now. If the device of a genlock's member showed
  // a volume that the others had dropped (genlock.h says when it may), it goes back to theirs.
  const bool strays = !seat.genlock.empty() && now() <= judge_.screen(d).disturbed_until;
  const std::string wrong = judge_.screen(d).eye.Sees(look, now(), strays);
  if (!wrong.empty()) Fail(absl::StrCat("display ", d, ": ", wrong));
  ++tally_.volumes;
}

void SimulationRun::OnSubmit(size_t d, uint64_t volume) {
  if (!wrong_.empty()) return;
  Explain(UINT64_MAX);
  OutcomeJudge::Screen& screen = judge_.screen(d);
  screen.eye.Asked(volume, seen_, screen.pattern || screen.pattern_changes, now());
  Trace(absl::StrCat("    display ", d, " has volume ", volume, " drawn, of snapshot ", seen_));
}

void SimulationRun::OnEngineFailed(size_t d, uint64_t volume, const absl::Status& status) {
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("    display ", d, ", volume ", volume,
                     ": the engine fails: ", status.message()));
  Disturb(d, now() + kEngineAftermath);
  ++tally_.faults;
}

void SimulationRun::OnFrame(size_t d, uint64_t volume, const daemon::testing::SceneModel& scene,
                            std::span<const std::byte> bytes) {
  if (!wrong_.empty()) return;
  OutcomeJudge::Screen& screen = judge_.screen(d);
  const Eye::Drawn* asked = screen.eye.Find(volume);
  if (asked == nullptr) return Fail("a volume was drawn that was not asked for");
  uint64_t snapshot = asked->snapshot, oldest = snapshot;
  if (!asked->pattern) {
    const PlainScene::Picture drawn = daemon::model::PictureOf(scene);
    const uint64_t whole = HashOf(drawn.shown) * 31 + HashOf(drawn.hidden);
    const auto newest = std::prev(pictured_.upper_bound(snapshot));
    bool found = newest->second.whole == whole;
    if (!world_->seats()[d].genlock.empty()) {
      // A round of a genlock shows the snapshot with which it began.
      found = false;
      for (auto it = pictured_.begin(); it != std::next(newest); ++it) {
        if (it->second.whole != whole) continue;
        if (!std::exchange(found, true)) oldest = it->first;
        snapshot = it->first;
      }
    }
    if (!found) {
      return Fail(absl::StrCat("volume ", volume, " on display ", d,
                               " was drawn from another scene than snapshot ", snapshot));
    }
  }
  const Look look = LookOf(bytes);
  Trace(absl::StrCat("    display ", d, ": volume ", volume, " looks ", look));
  screen.eye.Drew(volume, look, oldest, snapshot, now());
}

}  // namespace voxeld::simulation
