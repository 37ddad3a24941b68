#include "tests/simulation/outcome_judge.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace voxeld::simulation {

using daemon::Receipt;
using display::DisplayState;
using Kind = CommitOutcome::Kind;
using NotShown = CommitOutcome::NotShown;

void OutcomeJudge::OnApplied(const Applied& commit, sync::TimeNs now) {
  Entry entry{commit, now, {}};
  for (const Screen& screen : screens_) {
    OnScreen& on = entry.on.emplace_back();
    on.patterns = screen.patterns;
    if (removed_) on.may = Bit(NotShown::kRemoved);
    if (commit.asked) ++owed_;
  }
  of_stream_[{commit.session, commit.incarnation}].push_back(commits_.size());
  commits_.push_back(std::move(entry));
}

uint32_t OutcomeJudge::May(const Entry& entry, size_t d, DisplayState state) const {
  switch (state) {
    case DisplayState::kStopped:
      return Bit(NotShown::kRemoved);
    case DisplayState::kAttaching:
    case DisplayState::kLost:
      return Bit(NotShown::kAbsent);
    case DisplayState::kBlanked:
      return Bit(NotShown::kBlanked);
    case DisplayState::kShowing:
      break;
  }
  if (entry.commit.hidden) return Bit(NotShown::kHidden);
  if (screens_[d].pattern_changes) return Bit(NotShown::kHidden) | kRides;
  return screens_[d].pattern ? Bit(NotShown::kHidden) : kRides;
}

void OutcomeJudge::Boards(size_t d, DisplayState state) {
  boarding_to_[d] = commits_.size();
  for (size_t i = boarding_from_[d]; i < boarding_to_[d]; ++i) {
    commits_[i].on[d].may |= May(commits_[i], d, state);
  }
}

void OutcomeJudge::Boarded(size_t d, DisplayState state) {
  const size_t from = std::exchange(boarding_from_[d], boarding_to_[d]);
  // A setting that was posted together with the commits took effect before some of them, or after.
  if (!screens_[d].blank_changes) return;
  for (size_t i = from; i < boarding_to_[d]; ++i) {
    commits_[i].on[d].may |= May(commits_[i], d, state);
  }
}

void OutcomeJudge::Disturb(size_t d, sync::TimeNs until) {
  screens_[d].disturbed_until = std::max(screens_[d].disturbed_until, until);
}

OutcomeJudge::Entry* OutcomeJudge::Find(uint64_t session, const Receipt& receipt, size_t* index) {
  for (const size_t i : of_stream_[{session, receipt.incarnation}]) {
    if (commits_[i].commit.sequence != receipt.sequence) continue;
    if (index != nullptr) *index = i;
    return &commits_[i];
  }
  return nullptr;
}

std::string OutcomeJudge::Told(uint64_t session, const Receipt& receipt,
                               const CommitOutcome& outcome, sync::TimeNs now) {
  size_t index = 0;
  Entry* entry = Find(session, receipt, &index);
  if (entry == nullptr) return absl::StrCat("an outcome of no commit, sequence ", receipt.sequence);
  if (entry->commit.frame_id != receipt.frame_id) return "an outcome with another frame_id";
  if (!entry->commit.asked) return "an outcome that nobody asked for";
  for (size_t d = 0; d < screens_.size(); ++d) {
    if (screens_[d].name != outcome.display) continue;
    if (std::exchange(entry->on[d].told, true)) return "an outcome told twice";
    ++told_;
    ++kinds_[outcome.kind];
    return Judge(index, d, outcome, now);
  }
  return absl::StrCat("an outcome on no display: ", outcome.display);
}

void OutcomeJudge::TakeBack(uint64_t session, const Receipt& receipt) {
  const std::string& display = std::get<CommitOutcome>(receipt.what).display;
  Entry& entry = *Find(session, receipt, nullptr);
  taken_back_.insert(session);
  for (size_t d = 0; d < screens_.size(); ++d) {
    if (screens_[d].name == display && std::exchange(entry.on[d].told, false)) --told_;
  }
}

bool OutcomeJudge::LooksLike(size_t d, Look look, uint64_t to) const {
  const Eye& eye = screens_[d].eye;
  const bool drawn =
      std::any_of(eye.drawn().begin(), eye.drawn().end(), [look, to](const Eye::Drawn& volume) {
        return volume.snapshot >= to && volume.drawn_ns.has_value() && volume.look == look;
      });
  // Otherwise no volume was drawn for it: nothing had changed that an engine sees.
  return drawn || SameScene(eye, look, to);
}

bool OutcomeJudge::SameScene(const Eye& eye, Look look, uint64_t from) const {
  return std::any_of(eye.drawn().begin(), eye.drawn().end(), [&](const Eye::Drawn& drawn) {
    if (!drawn.drawn_ns.has_value() || drawn.look != look) return false;
    const uint64_t scene = std::prev(pictures_.upper_bound(drawn.snapshot))->second;
    return std::any_of(pictures_.lower_bound(from), pictures_.end(),
                       [scene](const auto& picture) { return picture.second == scene; });
  });
}

uint64_t OutcomeJudge::Missing(uint64_t session, uint64_t incarnation, std::string* which) const {
  uint64_t missing = 0;
  const auto it = of_stream_.find({session, incarnation});
  if (it == of_stream_.end()) return 0;
  for (const size_t i : it->second) {
    const Entry& entry = commits_[i];
    if (!entry.commit.asked) continue;
    for (size_t d = 0; d < screens_.size(); ++d) {
      if (entry.on[d].told || missing++ > 0) continue;
      *which = absl::StrCat("session ", session, " sequence ", entry.commit.sequence, " on ",
                            screens_[d].name);
    }
  }
  return missing;
}

bool OutcomeJudge::ShownBetween(const Eye& eye, uint64_t from, uint64_t to, uint64_t before) {
  return std::any_of(eye.drawn().begin(), eye.drawn().end(), [&](const Eye::Drawn& drawn) {
    return drawn.shown.has_value() && drawn.oldest_snapshot >= from &&
           (to == 0 || drawn.snapshot < to) && drawn.volume < before;
  });
}

std::string OutcomeJudge::Judge(size_t index, size_t d, const CommitOutcome& outcome,
                                sync::TimeNs now) {
  Entry& entry = commits_[index];
  const OnScreen& on = entry.on[d];
  const Screen& screen = screens_[d];
  if (outcome.kind == Kind::kNotShown) {
    const bool hidden_since =
        outcome.why == NotShown::kHidden && screen.patterns > on.patterns && (on.may & kRides) != 0;
    if ((on.may & Bit(outcome.why)) != 0 || hidden_since) return "";
    return absl::StrCat("NOT_SHOWN/", static_cast<int>(outcome.why), ", which it may not be (",
                        on.may, ")");
  }
  if ((on.may & kRides) == 0) {
    return absl::StrCat("outcome ", static_cast<int>(outcome.kind),
                        " of a commit that is not to be shown (", on.may, ")");
  }
  switch (outcome.kind) {
    case Kind::kLost:
      if (removed_ || entry.applied_ns <= screen.disturbed_until) return "";
      return absl::StrCat("LOST on a display that nothing has disturbed since ",
                          screen.disturbed_until, ": ", outcome.reason);
    case Kind::kPresented:
      return JudgePresented(entry, d, outcome, now);
    case Kind::kUnchanged:
      return JudgeUnchanged(entry, d, outcome);
    case Kind::kSuperseded:
      return JudgeSuperseded(index, d, outcome);
    case Kind::kNotShown:
      break;
  }
  return "an outcome of no kind";
}

std::string OutcomeJudge::JudgePresented(Entry& entry, size_t d, const CommitOutcome& outcome,
                                         sync::TimeNs now) {
  const Screen& screen = screens_[d];
  const Eye::Drawn* volume = screen.eye.Find(outcome.volume);
  if (volume == nullptr || !volume->drawn_ns.has_value()) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume, ", which was not drawn");
  }
  const bool disturbed = entry.applied_ns <= screen.disturbed_until;
  const sync::TimeNs tolerance = disturbed ? 10 * sync::kSecond : screen.tolerance;
  const bool lied = entry.applied_ns <= screen.lied_until;
  if (!lied && !screen.eye.WasShown(volume->look, outcome.time_ns, tolerance, *volume->drawn_ns)) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume, " at ", outcome.time_ns,
                        ", when nothing like it was shown");
  }
  if (!lied && outcome.time_ns > now + tolerance) return "PRESENTED before it is";
  if (volume->snapshot < entry.commit.snapshot) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume, ", which is older");
  }
  if (!lied && ShownBetween(screen.eye, entry.commit.snapshot, 0, outcome.volume)) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume,
                        ", though an earlier one with it was shown");
  }
  if (entry.commit.present_at != 0 && !disturbed &&
      outcome.time_ns < entry.commit.present_at - screen.tolerance) {
    return absl::StrCat("PRESENTED at ", outcome.time_ns, ", before its time ",
                        entry.commit.present_at);
  }
  // If several commits of one session are shown by one volume, only the newest is presented in it;
  // later commits are in later volumes.
  uint64_t& last = last_presented_[{d, entry.commit.session}];
  if (outcome.volume <= last && !taken_back_.contains(entry.commit.session)) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume, " after volume ", last);
  }
  last = std::max(last, outcome.volume);
  return "";
}

std::string OutcomeJudge::JudgeUnchanged(const Entry& entry, size_t d,
                                         const CommitOutcome& outcome) const {
  const Eye& eye = screens_[d].eye;
  const Eye::Drawn* same = eye.Find(outcome.volume);
  const bool lied = entry.applied_ns <= screens_[d].lied_until;
  if (same == nullptr || !same->drawn_ns.has_value()) {
    return absl::StrCat("UNCHANGED from volume ", outcome.volume, ", which was not drawn");
  }
  if (!lied && !eye.EverShown(same->look, *same->drawn_ns)) {
    return absl::StrCat("UNCHANGED from volume ", outcome.volume, ", which was not shown");
  }
  for (const Eye::Drawn& drawn : eye.drawn()) {
    if (drawn.snapshot < entry.commit.snapshot || !drawn.drawn_ns.has_value()) continue;
    if (drawn.look == same->look) return "";
    break;  // the first one drawn with it decides
  }
  // No volume was drawn for it: nothing had changed that an engine sees.
  if (SameScene(eye, same->look, entry.commit.snapshot)) return "";
  return absl::StrCat("UNCHANGED from volume ", outcome.volume, ", which looks otherwise");
}

std::string OutcomeJudge::JudgeSuperseded(size_t index, size_t d,
                                          const CommitOutcome& outcome) const {
  const Applied& commit = commits_[index].commit;
  for (size_t i = index + 1; i < commits_.size(); ++i) {
    const Applied& by = commits_[i].commit;
    if (by.session != commit.session || by.sequence != outcome.by_sequence ||
        by.frame_id != outcome.by_frame_id) {
      continue;
    }
    if ((commits_[i].on[d].may & kRides) == 0) return "SUPERSEDED by one that does not ride";
    if (ShownBetween(screens_[d].eye, commit.snapshot, by.snapshot, UINT64_MAX)) {
      return "SUPERSEDED by one that rode later: a volume with the first alone was shown";
    }
    return "";
  }
  return absl::StrCat("SUPERSEDED by no later commit of the session: sequence ",
                      outcome.by_sequence);
}

}  // namespace voxeld::simulation
