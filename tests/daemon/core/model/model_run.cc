#include "tests/daemon/core/model/model_run.h"

#include <algorithm>

#include "absl/hash/hash.h"
#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/engine_picture.h"

namespace voxeld::daemon::model {
namespace {

std::vector<std::string> DisplayNames(int displays) {
  std::vector<std::string> names;
  for (int i = 0; i < displays; ++i) names.push_back(i == 0 ? "main" : absl::StrCat("display", i));
  return names;
}

}  // namespace

ModelRun::ModelRun(const Script& script, std::ostream* trace)
    : CoreJudge(script.limits, DisplayNames(script.displays), trace),
      script_(script),
      ledger_(DisplayNames(script.displays)),
      asked_(static_cast<size_t>(script.displays)),
      now_(static_cast<size_t>(script.displays)),
      sim_(script.limits, script.displays) {
  for (size_t d = 0; d < now_.size(); ++d) {
    testing::EngineScript& engine = sim_.engine(static_cast<int>(d));
    engine.on_submit = [this, d](uint64_t volume) { OnSubmit(d, volume); };
    engine.on_frame = [this, d](uint64_t volume, const testing::SceneModel& scene) {
      OnFrame(d, volume, scene);
    };
    testing::ScriptedDisplay& display = sim_.display(static_cast<int>(d));
    display.on_send = [this, d](uint64_t volume) { ledger_.Sent(d, volume); };
    display.attach_at_once = (script.seed + d) % 8 != 0;
    now_[d].attached = display.attach_at_once;
    SetState(d);
  }
}

ModelRun::~ModelRun() {
  // The core's actions during its shutdown are not judged.
  for (size_t d = 0; d < now_.size(); ++d) {
    sim_.engine(static_cast<int>(d)).on_submit = nullptr;
    sim_.engine(static_cast<int>(d)).on_frame = nullptr;
    sim_.display(static_cast<int>(d)).on_send = nullptr;
  }
  Over();
  sim_.core.reset();
}

size_t ModelRun::HashOf(const std::string& text) { return absl::Hash<std::string>()(text); }

RandomMessage ModelRun::Compose(Chance& chance, uint64_t last_sequence, uint64_t* next_frame_id) {
  return MakeMessage(chance, last_sequence, next_frame_id, sim_.clock.Now());
}

void ModelRun::OnPictured(uint64_t snapshot) {
  ledger_.Pictured(snapshot, HashOf(plain_.scene.Draw().seen));
}

std::string ModelRun::OnTold(uint64_t session, const Receipt& receipt,
                             const CommitOutcome& outcome) {
  return ledger_.Told(session, receipt.frame_id, receipt.sequence, receipt.incarnation, outcome);
}

void ModelRun::OnTakenBack(uint64_t session, const Receipt& receipt) {
  ledger_.TakeBack(session, receipt.sequence, receipt.incarnation,
                   std::get<CommitOutcome>(receipt.what).display);
}

bool ModelRun::Idle(size_t d) {
  testing::ScriptedDisplay& display = sim_.display(static_cast<int>(d));
  return display.state() == display::DisplayState::kShowing && display.in_flight() == nullptr &&
         sim_.engine(static_cast<int>(d)).calls.empty();
}

// ------------------------------------------------------------------------------ drawing

void ModelRun::OnSubmit(size_t display, uint64_t volume) {
  if (!wrong_.empty()) return;
  Explain(UINT64_MAX);
  ledger_.Asked(display, volume, seen_);
  asked_[display][volume] = {plain_.scene.Draw(), now_[display].pattern};
  if (sim_.engine(static_cast<int>(display)).fail.has_value()) {
    ledger_.Loss(display, now_[display].armed);
  }
}

void ModelRun::OnFrame(size_t display, uint64_t volume, const testing::SceneModel& scene) {
  if (!wrong_.empty()) return;
  const PlainScene::Picture drawn = PictureOf(scene);
  ledger_.Drawn(display, volume, HashOf(drawn.seen));
  const auto it = asked_[display].find(volume);
  if (it == asked_[display].end()) return Fail("a volume was drawn that was not asked for");
  if (!it->second.pattern && it->second.picture != drawn) {
    Fail(absl::StrCat("volume ", volume, " on display ", display,
                      " was drawn from another scene than the newest"));
  }
  asked_[display].erase(it);
}

}  // namespace voxeld::daemon::model
