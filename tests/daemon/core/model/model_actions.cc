// The actions on the core's displays, and how the model is informed of them.
#include <algorithm>
#include <exception>

#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/model_run.h"

namespace voxeld::daemon::model {
namespace {

std::string NameOf(size_t display) {
  return display == 0 ? "main" : absl::StrCat("display", display);
}

}  // namespace

std::string ModelRun::Run() {
  try {
    RunScript();
  } catch (const std::exception& thrown) {
    Fail(absl::StrCat("thrown: ", thrown.what()));
  }
  return wrong_;
}

void ModelRun::RunScript() {
  if (!sim_.core->Start().ok()) return Fail("the core does not start");
  Begin();
  for (const Action& action : script_.actions) {
    Do(action);
    if (action.chance % 8 == 0) {
      Step();
      CheckStats();
    }
    if (!wrong_.empty()) return;
  }
  Step();
  CheckStats();
  if (script_.settles) {
    Settle();
    Leave();
  } else {
    for (size_t d = 0; d < now_.size(); ++d) ledger_.Loss(d, "stopped");
    ledger_.Removed();
    StopInTheMiddle();
  }
}

void ModelRun::Do(const Action& action) {
  Chance chance(action.chance);
  const size_t displays = now_.size();
  const size_t d = displays == 0 ? 0 : chance.Pick(static_cast<uint32_t>(displays));
  if (Act(action, chance)) return;
  if (action.kind == ActionKind::kAdvance) {
    return Advance(chance.OneIn(8) ? (1 + chance.Pick(12)) * sync::kSecond
                                   : (1 + chance.Pick(10)) * 30 * sync::kMillisecond);
  }
  if (displays == 0) return;
  testing::EngineScript& engine = sim_.engine(static_cast<int>(d));
  switch (action.kind) {
    case ActionKind::kShow:
      return Show(d);
    case ActionKind::kAbort: {
      const std::string reason = absl::StrCat("aborted #", ++happenings_, ".");
      Trace(absl::StrCat("display ", d, " ", reason));
      ledger_.Loss(d, reason);
      sim_.display(static_cast<int>(d)).Abort(reason);
      return Step();
    }
    case ActionKind::kCable:
      if (!now_[d].attached || chance.OneIn(6)) Cable(d);
      return;
    case ActionKind::kBlank:
      if (now_[d].blanked || chance.OneIn(6)) Blank(d, !now_[d].blanked);
      return;
    case ActionKind::kPattern:
      if (now_[d].pattern) return Pattern(d, TestPattern::kNone);
      if (chance.OneIn(6)) Pattern(d, TestPattern::kGrid);
      return;
    case ActionKind::kEngineMode:
      if (engine.calls.empty()) engine.inline_calls = !engine.inline_calls;
      return;
    case ActionKind::kEngineRun:
      Trace(absl::StrCat("engine ", d, " runs"));
      engine.Run();
      return Step();
    case ActionKind::kEngineFail:
      return EngineFail(d, d == 0 && chance.OneIn(2));
    default:
      return;
  }
}

void ModelRun::Advance(sync::TimeNs delta) {
  Step();
  if (!wrong_.empty()) return;
  sim_.clock.Advance(delta);
  PassTime();
  Step();
}

// -------------------------------------------------------------------------------------- displays

void ModelRun::SetState(size_t d) {
  const DisplayNow& now = now_[d];
  ledger_.State(d, now.attached ? (now.blanked ? display::DisplayState::kBlanked
                                               : display::DisplayState::kShowing)
                                : display::DisplayState::kLost);
}

void ModelRun::Show(size_t d) {
  testing::ScriptedDisplay& display = sim_.display(static_cast<int>(d));
  if (const display::SliceFramePtr frame = display.in_flight()) {
    Trace(absl::StrCat("display ", d, " shows volume ", frame->volume));
    ledger_.Shown(d, frame->volume, sim_.clock.Now());
    display.Show();
  }
  Step();
}

void ModelRun::Cable(size_t d) {
  testing::ScriptedDisplay& display = sim_.display(static_cast<int>(d));
  now_[d].attached = !now_[d].attached;
  SetState(d);
  if (now_[d].attached) {
    Trace(absl::StrCat("display ", d, " attaches"));
    display.Attach();
  } else {
    const std::string reason = absl::StrCat("cable pulled #", ++happenings_, ".");
    Trace(absl::StrCat("display ", d, " ", reason));
    ledger_.Loss(d, reason);
    display.Lose(reason);
  }
  Step();
}

void ModelRun::Blank(size_t d, bool blank) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("display ", d, blank ? " dark" : " light"));
  now_[d].blanked = blank;
  if (blank) ledger_.Loss(d, "blanked");
  SetState(d);
  DisplayUpdate update;
  update.blank = blank;
  if (!sim_.Update(update, NameOf(d)).ok()) Fail("a display was not blanked");
  CheckAtRest();
}

void ModelRun::Pattern(size_t d, TestPattern pattern) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("display ", d, " pattern ", static_cast<int>(pattern)));
  now_[d].pattern = pattern != TestPattern::kNone;
  ledger_.Pattern(d, now_[d].pattern);
  DisplayUpdate update;
  update.pattern = pattern;
  if (!sim_.Update(update, NameOf(d)).ok()) Fail("a display has no pattern");
  CheckAtRest();
}

void ModelRun::EngineFail(size_t d, bool lost) {
  now_[d].armed = absl::StrCat(lost ? "engine gone #" : "frame failed #", ++happenings_, ".");
  Trace(absl::StrCat("engine ", d, " will fail: ", now_[d].armed));
  ledger_.Loss(d, now_[d].armed);
  sim_.engine(static_cast<int>(d)).fail =
      lost ? absl::DataLossError(now_[d].armed) : absl::InternalError(now_[d].armed);
}

}  // namespace voxeld::daemon::model
