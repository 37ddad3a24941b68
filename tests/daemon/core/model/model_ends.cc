// How a run ends, and how one that went wrong is cut down.
#include <algorithm>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/model_run.h"

namespace voxeld::daemon::model {

// Everything comes back and is shown: then nobody is owed anything any more.
void ModelRun::Settle() {
  Trace("everything settles");
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    sim_.engine(static_cast<int>(d)).fail.reset();
    if (now_[d].blanked) Blank(d, false);
    if (now_[d].pattern) Pattern(d, TestPattern::kNone);
    if (!now_[d].attached) Cable(d);
  }
  for (const std::unique_ptr<Stream>& stream : streams_) {
    PlainSession* session = SessionOf(*stream);
    if (stream->open && session != nullptr && session->crowded) Crowd(*stream, false);
  }
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
  for (const std::unique_ptr<Stream>& stream : streams_) {
    if (!wrong_.empty()) return;
    const PlainSession* session = SessionOf(*stream);
    if (!stream->open || session == nullptr) continue;
    if (session->waits() || !session->timed.empty()) {
      return Fail(absl::StrCat("session ", session->id, " waits though all is shown"));
    }
    std::string which;
    if (const uint64_t n = ledger_.Missing(session->id, session->incarnation, &which); n > 0) {
      return Fail(absl::StrCat(n, " outcomes were never told, the first: ", which));
    }
  }
}

void ModelRun::EverybodyLeaves() {
  for (uint32_t place = 0; place < kPlaces && wrong_.empty(); ++place) {
    Stream* stream = places_[place];
    if (stream == nullptr || !stream->open || SessionOf(*stream) == nullptr) continue;
    Close(place, place % 2 == 0, 0);
  }
  for (const std::unique_ptr<Stream>& stream : streams_) {
    if (wrong_.empty() && stream->open && SessionOf(*stream) != nullptr) {
      // A place was taken over by another stream.
      Control({.owner = SessionOf(*stream)->owner, .evict = true});
    }
  }
  Advance(31 * sync::kSecond);
  if (!wrong_.empty()) return;
  ClearLayer(0, "", false);
  while (wrong_.empty() && !plain_.scene.owners.empty()) {
    Control({.owner = plain_.scene.owners.begin()->first, .evict = true});
  }
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    while (sim_.display(static_cast<int>(d)).in_flight() != nullptr && wrong_.empty()) Show(d);
  }
  if (!wrong_.empty()) return;
  CheckStats();
  const Stats stats = sim_.GetStats();
  if (ledger_.owed() != ledger_.told() + stats.outcomes_undelivered) {
    Fail(absl::StrCat(ledger_.owed(), " outcomes were owed, ", ledger_.told(), " told, ",
                      stats.outcomes_undelivered, " counted as undelivered"));
  }
  if (const uint64_t held = sim_.core->budget()->used_bytes(); held != 0) {
    Fail(absl::StrCat("everybody has left, and ", held, " bytes are held"));
  }
  for (size_t use = 0; use < Budget::kUses; ++use) {
    if (sim_.core->budget()->used_bytes(static_cast<Budget::Use>(use)) != 0) {
      Fail(absl::StrCat("everybody has left, and use ", use, " of the budget is not 0"));
    }
  }
}

// Who is there when the daemon ends is told what became of each commit that was accepted.
void ModelRun::StopInTheMiddle() {
  if (!wrong_.empty()) return;
  Trace("the core stops");
  stopping_ = true;
  for (size_t d = 0; d < now_.size(); ++d) ledger_.Loss(d, "stopped");
  ledger_.Removed();
  std::vector<Stream*> open;
  for (const std::unique_ptr<Stream>& stream : streams_) {
    if (!stream->open || SessionOf(*stream) == nullptr) continue;
    stream->may_end = true;
    open.push_back(stream.get());
  }
  if (!sim_.core->Stop(sync::kSecond).ok()) return Fail("the core does not stop");
  Explain(UINT64_MAX);
  for (Stream* stream : open) {
    if (!wrong_.empty()) return;
    if (!stream->ended) return Fail("a stream was not ended");
    std::string which;
    if (const uint64_t n = ledger_.Missing(stream->info.session, stream->info.incarnation, &which);
        n > 0) {
      return Fail(absl::StrCat(n, " outcomes were never told, the first: ", which));
    }
  }
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
