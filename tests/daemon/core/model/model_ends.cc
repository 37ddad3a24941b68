// How a run ends, and how a run with an error is shrunk.
#include <algorithm>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/model_run.h"

namespace voxeld::daemon::model {

// Every display returns and shows everything: then no outcome is outstanding.
void ModelRun::Settle() {
  Trace("everything settles");
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    sim_.engine(static_cast<int>(d)).fail.reset();
    if (now_[d].blanked) Blank(d, false);
    if (now_[d].pattern) Pattern(d, TestPattern::kNone);
    if (!now_[d].attached) Cable(d);
  }
  EverybodyReads();
  for (int i = 0; i < 400 && wrong_.empty(); ++i) {
    bool any = false;
    for (size_t d = 0; d < now_.size(); ++d) {
      testing::EngineScript& engine = sim_.engine(static_cast<int>(d));
      if (!engine.calls.empty() && engine.Run()) any = true;
      Step();
      any = any || sim_.display(static_cast<int>(d)).in_flight() != nullptr;
      Show(d);
    }
    for (const auto& [id, session] : plain_.sessions) any = any || !session.timed.empty();
    if (!any && i > 12) break;
    if (i % 4 == 3) Advance(sync::kSecond);
  }
  CheckStats();
  const size_t newest = HashOf(plain_.scene.Draw().seen);
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    if (!ledger_.ShowsLast(d, newest)) Fail(absl::StrCat("display ", d, " shows an old scene"));
  }
  CheckNobodyWaits();
}

void ModelRun::Leave() {
  EverybodyLeaves();
  if (wrong_.empty()) Advance(31 * sync::kSecond);
  EvictEverybody();
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    while (sim_.display(static_cast<int>(d)).in_flight() != nullptr && wrong_.empty()) Show(d);
  }
  if (!wrong_.empty()) return;
  const Stats stats = AskStats();
  CheckNothingIsHeld(ledger_.owed(), ledger_.told() + stats.outcomes_undelivered);
}

// ------------------------------------------------------------------------------------- shrinking

std::string RunAndShrink(const Script& script) {
  std::string wrong = ModelRun(script).Run();
  if (wrong.empty()) return "";
  Script least = script;
  for (size_t chunk = std::max<size_t>(least.actions.size() / 2, 1);; chunk /= 2) {
    for (size_t at = 0; at < least.actions.size();) {
      Script fewer = least;
      const auto from = fewer.actions.begin() + static_cast<std::ptrdiff_t>(at);
      const size_t n = std::min(chunk, fewer.actions.size() - at);
      fewer.actions.erase(from, from + static_cast<std::ptrdiff_t>(n));
      if (ModelRun(fewer).Run().empty()) {
        at += chunk;
      } else {
        least = std::move(fewer);
      }
    }
    if (chunk <= 1) break;
  }
  std::ostringstream trace;
  ModelRun(least, &trace).Run();
  return absl::StrCat("seed ", script.seed, ": ", wrong, "\ncut down to ", least.actions.size(),
                      " of ", script.actions.size(), " actions:\n", trace.str());
}

}  // namespace voxeld::daemon::model
