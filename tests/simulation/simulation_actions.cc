// The actions on displays, their devices and engines, and on time.
#include <algorithm>
#include <exception>

#include "absl/strings/str_cat.h"
#include "tests/simulation/simulation_run.h"

namespace voxeld::simulation {
namespace {

using daemon::TestPattern;
using daemon::model::ActionKind;
using sync::kMillisecond;
using sync::kSecond;

constexpr sync::TimeNs kJumpAftermath = 6 * kSecond;

}  // namespace

void SimulationRun::RunScenario() {
  for (const SeatOptions& seat : scenario_.seats) {
    std::string text = absl::StrCat("display ", seat.name, " ", seat.setup.genlock);
    for (const auto& [key, value] : seat.device) absl::StrAppend(&text, " ", key, "=", value);
    Trace(text);
  }
  OnPictured(core().scene_watch().newest()->number);
  if (!world_->Start().ok()) return Fail("the core does not start");
  Begin();
  for (const Action& action : scenario_.actions) {
    Do(action);
    if (action.chance % 8 == 0 && wrong_.empty()) {
      Step();
      CheckStats();
      CheckQuiet();
    }
    if (!wrong_.empty()) return;
  }
  Step();
  CheckStats();
  if (scenario_.settles) {
    Settle();
    Leave();
  } else {
    for (size_t d = 0; d < now_.size(); ++d) judge_.Disturb(d, sync::kNever);
    judge_.Removed();
    StopInTheMiddle();
  }
}

void SimulationRun::Do(const Action& action) {
  Chance chance(action.chance);
  const size_t d = chance.Pick(static_cast<uint32_t>(now_.size()));
  switch (action.kind) {
    case ActionKind::kClose:
    case ActionKind::kResume:
    case ActionKind::kEvict:
      // It could not be predicted what a session that ends does with a commit whose time is coming,
      // nor, with limits that all sessions share, whether its last commits come before those of
      // others.
      Step();
      AwaitCertainty();
      // Nor could the order be predicted in which commits for one sweep are applied when it ends.
      if (std::any_of(plain_.sessions.begin(), plain_.sessions.end(),
                      [](const auto& entry) { return entry.second.due.size() > 1; })) {
        return;
      }
      break;
    case ActionKind::kStep:
      switch (chance.Pick(6)) {
        case 0:
          return Capture(d, chance);
        case 1:
          return Watch(d);
        case 2: {
          const double brightness = chance.Pick(5) / 4.0;
          Trace(absl::StrCat("display ", d, " brightness ", brightness));
          Update(d, {.brightness = brightness});
          now_[d].brightness = brightness;
          return;
        }
        case 3:
          if (scenario_.memory_ends) return FillMemory(!plain_.memory_full);
          break;
        default:
          break;
      }
      break;
    default:
      break;
  }
  if (!wrong_.empty() || Act(action, chance)) return;
  DoToDisplay(action, chance, d);
}

void SimulationRun::DoToDisplay(const Action& action, Chance& chance, size_t d) {
  const Seat& seat = world_->seats()[d];
  DisplayNow& is = now_[d];
  OutcomeJudge::Screen& screen = judge_.screen(d);
  switch (action.kind) {
    case ActionKind::kShow:
    case ActionKind::kEngineRun:
      return Advance(chance.Pick(60) * kMillisecond);
    case ActionKind::kAdvance:
      if (scenario_.jumps && chance.OneIn(3)) return Jump(chance.Pick(4000) * kMillisecond);
      return Advance(chance.OneIn(8) ? (1 + chance.Pick(3)) * kSecond
                                     : (1 + chance.Pick(10)) * 30 * kMillisecond);
    case ActionKind::kAbort:
    case ActionKind::kCable: {
      if (!is.plugged) return Cable(d, true);
      if (scenario_.lies && (is.lies || chance.OneIn(3))) return Lie(d, !is.lies, chance.Next());
      if (!scenario_.device_faults) return;
      if (action.kind == ActionKind::kCable && chance.OneIn(3)) return Cable(d, false);
      const display::emulator::Fault fault = RandomFault(chance);
      Trace(absl::StrCat("display ", d, " fault ", display::emulator::ToText(fault)));
      ++tally_.faults;
      seat.carrier->WithDevice([&](display::UsbDeviceModel&) { seat.faults->Add(fault); });
      world_->Touch(d);
      NoteDisturbances(d);
      return Step();
    }
    case ActionKind::kBlank: {
      if (!is.blanked && !chance.OneIn(6)) return;
      is.blanked = !is.blanked;
      Trace(absl::StrCat("display ", d, is.blanked ? " dark" : " light"));
      // A volume that is on its way when the display goes dark is lost, and a genlock starts again.
      judge_.Disturb(d, now());
      if (!seat.genlock.empty()) Disturb(d, now() + kJumpAftermath);
      screen.blank_changes = true;
      Update(d, {.blank = is.blanked});
      screen.blank_changes = false;
      return;
    }
    case ActionKind::kPattern: {
      if (!screen.pattern && !chance.OneIn(6)) return;
      Trace(absl::StrCat("display ", d, " pattern ", !screen.pattern));
      if (!screen.pattern) ++screen.patterns;
      screen.pattern_changes = true;
      Update(d, {.pattern = screen.pattern ? TestPattern::kNone : TestPattern::kGrid});
      screen.pattern_changes = false;
      screen.pattern = !screen.pattern;
      changed_ns_ = now();
      return;
    }
    case ActionKind::kEngineMode:
      slow_engines_until_ = now() + chance.Pick(600) * kMillisecond;
      return;
    case ActionKind::kEngineFail:
      if (!scenario_.engine_faults) return;
      Trace(absl::StrCat("engine ", d, " will fail"));
      if (chance.OneIn(4)) {
        seat.engine->fail_staging = true;
      } else {
        seat.engine->fail = chance.OneIn(2) ? absl::DataLossError("gone, as planned")
                            : chance.OneIn(2)
                                ? absl::ResourceExhaustedError("no memory, as planned")
                                : absl::InternalError("failed, as planned");
      }
      NoteDisturbances(d);
      return;
    default:
      return;
  }
}

void SimulationRun::Advance(sync::TimeNs delta) {
  const sync::TimeNs end = now() + delta;
  Step();
  while (wrong_.empty() && now() < end) {
    clock().AdvanceTo(std::max(now() + 1, std::min({end, world_->Next(), plain_.NextDue()})));
    PassTime();
    Step();
    CheckCaptures();
    CheckGenlock();
  }
}

// Nothing runs for a while: the machine was suspended, or busy.
void SimulationRun::Jump(sync::TimeNs delta) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("time jumps by ", delta));
  for (size_t d = 0; d < now_.size(); ++d) {
    judge_.Disturb(d, now() + delta + kJumpAftermath);
    judge_.screen(d).eye.Blinked(now(), now() + delta);
  }
  clock().Advance(delta);
  PassTime();
  Step();
}

void SimulationRun::FillMemory(bool full) {
  using Use = daemon::Budget::Use;
  daemon::Budget& budget = *core().budget();
  Step();
  Trace(full ? "memory is full" : "there is memory again");
  if (full) {
    budget.ChargeAnyway(Use::kArriving, 2 * budget.limit_bytes());
  } else {
    budget.Release(Use::kArriving, 2 * budget.limit_bytes());
  }
  plain_.memory_full = full;
}

void SimulationRun::AwaitCertainty() {
  const auto uncertain = [this] {
    return std::any_of(plain_.sessions.begin(), plain_.sessions.end(),
                       [this](const auto& entry) { return plain_.Uncertain(entry.second, now()); });
  };
  while (wrong_.empty() && uncertain()) Advance(7 * kMillisecond);
}

void SimulationRun::Cable(size_t d, bool plugged) {
  Trace(absl::StrCat("display ", d, plugged ? " is plugged in" : " is unplugged"));
  ++tally_.faults;
  now_[d].plugged = plugged;
  world_->seats()[d].carrier->WithDevice(
      [&](display::UsbDeviceModel& device) { device.SetPlugged(plugged); });
  world_->Touch(d);
  NoteDisturbances(d);
  Step();
}

void SimulationRun::Lie(size_t d, bool lies, uint32_t seed) {
  Trace(absl::StrCat("the device of display ", d, lies ? " lies" : " tells the truth"));
  ++tally_.faults;
  NoteDisturbances(d);
  now_[d].lies = lies;
  const Seat& seat = world_->seats()[d];
  seat.carrier->WithDevice([&](display::UsbDeviceModel&) {
    seat.liar->SetSeed(lies ? std::optional<uint64_t>(seed) : std::nullopt);
  });
  NoteDisturbances(d);
  Step();
}

void SimulationRun::Update(size_t d, const daemon::DisplayUpdate& update) {
  Step();
  if (!wrong_.empty()) return;
  std::optional<absl::Status> answer;
  core().UpdateDisplay(world_->seats()[d].name, update,
                       [&](const auto& result) { answer = result.status(); });
  Step();
  if (!answer.has_value()) return Fail("a display was not updated");
  if (!answer->ok()) Fail(absl::StrCat("a display was not updated: ", answer->message()));
}

void SimulationRun::Capture(size_t d, Chance& chance) {
  const size_t number = captures_.size();
  const sync::TimeNs timeout = (chance.OneIn(3) ? 200 : 3000) * kMillisecond;
  captures_.push_back({d, chance.OneIn(3) ? 0 : seen_, now(), now() + timeout, false});
  Trace(absl::StrCat("capture ", number, " of display ", d, ", ", captures_.back().at_least));
  core().Capture(world_->seats()[d].name, timeout, captures_.back().at_least,
                 [this, d, number](const absl::StatusOr<display::DecodedVolume>& volume) {
                   OnCaptured(d, number, volume);
                 });
  Step();
}

void SimulationRun::Watch(size_t d) {
  DisplayNow& is = now_[d];
  const std::string& name = world_->seats()[d].name;
  if (is.watch != 0) {
    Trace(absl::StrCat("display ", d, " is watched no more"));
    core().UnwatchVolumes(name, std::exchange(is.watch, 0));
    Step();
    is.watched.reset();
    is.watched_volume = 0;
    return;
  }
  Trace(absl::StrCat("display ", d, " is watched"));
  is.watched_since = now();
  is.watch = core().WatchVolumes(
      name,
      [this, d](const absl::StatusOr<display::DecodedVolume>& volume) { OnWatched(d, volume); });
  Step();
}

}  // namespace voxeld::simulation
