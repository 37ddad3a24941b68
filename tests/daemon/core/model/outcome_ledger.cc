#include "tests/daemon/core/model/outcome_ledger.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::model {

using Kind = CommitOutcome::Kind;
using NotShown = CommitOutcome::NotShown;
using display::DisplayState;

OutcomeLedger::OutcomeLedger(std::vector<std::string> displays) {
  for (std::string& name : displays) displays_.emplace_back().name = std::move(name);
}

void OutcomeLedger::Applied(const Commit& commit) {
  Entry entry;
  entry.commit = commit;
  for (const Display& display : displays_) {
    OnDisplay& on = entry.on.emplace_back();
    on.losses = display.losses.size();
    on.patterns = display.patterns;
    if (removed_) {
      on.not_shown = NotShown::kRemoved;
    } else if (display.state == DisplayState::kBlanked) {
      on.not_shown = NotShown::kBlanked;
    } else if (display.state != DisplayState::kShowing) {
      on.not_shown = NotShown::kAbsent;
    } else if (commit.hidden || display.pattern) {
      on.not_shown = NotShown::kHidden;
    }
    if (commit.asked) ++owed_;
  }
  of_stream_[{commit.session, commit.incarnation}].push_back(commits_.size());
  commits_.push_back(std::move(entry));
}

void OutcomeLedger::Asked(size_t display, uint64_t volume, uint64_t snapshot) {
  displays_[display].volumes.push_back({volume, snapshot, {}, false, {}});
}

OutcomeLedger::Volume* OutcomeLedger::FindVolume(Display& display, uint64_t number) {
  for (auto it = display.volumes.rbegin(); it != display.volumes.rend(); ++it) {
    if (it->number == number) return &*it;
  }
  return nullptr;
}

void OutcomeLedger::Drawn(size_t display, uint64_t volume, size_t picture) {
  FindVolume(displays_[display], volume)->picture = picture;
}

void OutcomeLedger::Sent(size_t display, uint64_t volume) {
  // A black volume of the display's own has no number.
  if (Volume* sent = FindVolume(displays_[display], volume)) sent->sent = true;
}

void OutcomeLedger::Shown(size_t display, uint64_t volume, sync::TimeNs time) {
  Volume* shown = FindVolume(displays_[display], volume);
  if (shown != nullptr && !shown->shown.has_value()) shown->shown = time;
}

void OutcomeLedger::Loss(size_t display, const std::string& reason) {
  displays_[display].losses.push_back(reason);
}

void OutcomeLedger::State(size_t display, DisplayState state) { displays_[display].state = state; }

void OutcomeLedger::Pattern(size_t display, bool on) {
  displays_[display].pattern = on;
  if (on) ++displays_[display].patterns;
}

OutcomeLedger::Entry* OutcomeLedger::Find(uint64_t session, uint64_t incarnation, uint64_t sequence,
                                          size_t* index) {
  for (const size_t i : of_stream_[{session, incarnation}]) {
    if (commits_[i].commit.sequence != sequence) continue;
    if (index != nullptr) *index = i;
    return &commits_[i];
  }
  return nullptr;
}

std::string OutcomeLedger::Told(uint64_t session, uint64_t frame_id, uint64_t sequence,
                                uint64_t incarnation, const CommitOutcome& outcome) {
  size_t index = 0;
  Entry* entry = Find(session, incarnation, sequence, &index);
  if (entry == nullptr) return absl::StrCat("an outcome of no commit, sequence ", sequence);
  if (entry->commit.frame_id != frame_id) return "an outcome with another frame_id";
  if (!entry->commit.asked) return "an outcome that nobody asked for";
  for (size_t d = 0; d < displays_.size(); ++d) {
    if (displays_[d].name != outcome.display) continue;
    if (std::exchange(entry->on[d].told, true)) return "an outcome told twice";
    ++told_;
    ++kinds_[outcome.kind];
    return Judge(index, d, outcome);
  }
  return absl::StrCat("an outcome on no display: ", outcome.display);
}

void OutcomeLedger::TakeBack(uint64_t session, uint64_t sequence, uint64_t incarnation,
                             const std::string& display) {
  Entry& entry = *Find(session, incarnation, sequence, nullptr);
  for (size_t d = 0; d < displays_.size(); ++d) {
    if (displays_[d].name != display || !std::exchange(entry.on[d].told, false)) continue;
    --told_;
    if (entry.on[d].presented != 0) {
      --presented_[{d, session, std::exchange(entry.on[d].presented, 0)}];
    }
  }
}

bool OutcomeLedger::ShowsLast(size_t display, size_t picture) const {
  const std::vector<Volume>& volumes = displays_[display].volumes;
  const auto last = std::find_if(volumes.rbegin(), volumes.rend(),
                                 [](const Volume& volume) { return volume.shown.has_value(); });
  return last != volumes.rend() && last->picture == picture;
}

uint64_t OutcomeLedger::Missing(uint64_t session, uint64_t incarnation, std::string* which) const {
  uint64_t missing = 0;
  const auto it = of_stream_.find({session, incarnation});
  if (it == of_stream_.end()) return 0;
  for (const size_t i : it->second) {
    const Entry& entry = commits_[i];
    if (!entry.commit.asked) continue;
    for (size_t d = 0; d < displays_.size(); ++d) {
      if (entry.on[d].told) continue;
      if (missing++ == 0) {
        *which = absl::StrCat("session ", session, " sequence ", entry.commit.sequence, " on ",
                              displays_[d].name);
      }
    }
  }
  return missing;
}

bool OutcomeLedger::SentBetween(const Display& display, uint64_t from, uint64_t to,
                                uint64_t before) {
  return std::any_of(display.volumes.begin(), display.volumes.end(), [&](const Volume& volume) {
    return volume.sent && volume.snapshot >= from && (to == 0 || volume.snapshot < to) &&
           volume.number < before;
  });
}

std::string OutcomeLedger::Judge(size_t index, size_t d, const CommitOutcome& outcome) {
  Entry& entry = commits_[index];
  const OnDisplay& on = entry.on[d];
  const Display& display = displays_[d];
  if (on.not_shown.has_value()) {
    if (outcome.kind == Kind::kNotShown && outcome.why == *on.not_shown) return "";
    return absl::StrCat("outcome ", static_cast<int>(outcome.kind), "/",
                        static_cast<int>(outcome.why), " where NOT_SHOWN/",
                        static_cast<int>(*on.not_shown), " is due");
  }
  switch (outcome.kind) {
    case Kind::kNotShown:
      if (outcome.why == NotShown::kHidden && display.patterns > on.patterns) return "";
      return absl::StrCat("NOT_SHOWN/", static_cast<int>(outcome.why), " of a commit that rides");
    case Kind::kLost:
      for (size_t i = on.losses; i < display.losses.size(); ++i) {
        if (outcome.reason.find(display.losses[i]) != std::string::npos) return "";
      }
      return absl::StrCat("LOST for what did not happen since: ", outcome.reason);
    case Kind::kPresented:
      return JudgePresented(entry, d, outcome);
    case Kind::kUnchanged:
      return JudgeUnchanged(entry, d, outcome);
    case Kind::kSuperseded:
      return JudgeSuperseded(index, d, outcome);
  }
  return "an outcome of no kind";
}

std::string OutcomeLedger::JudgePresented(Entry& entry, size_t d, const CommitOutcome& outcome) {
  const Volume* volume = FindVolume(displays_[d], outcome.volume);
  if (volume == nullptr || !volume->shown.has_value()) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume, ", which was not shown");
  }
  if (*volume->shown != outcome.time_ns) return "PRESENTED at another time";
  if (volume->snapshot < entry.commit.snapshot) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume, ", which is older");
  }
  if (SentBetween(displays_[d], entry.commit.snapshot, 0, outcome.volume)) {
    return absl::StrCat("PRESENTED in volume ", outcome.volume,
                        ", though an earlier one with it was sent");
  }
  // If several commits of one session are shown by one volume, only the newest is presented.
  entry.on[d].presented = outcome.volume;
  if (presented_[{d, entry.commit.session, outcome.volume}]++ > 0) {
    return absl::StrCat("a second PRESENTED of one session in volume ", outcome.volume);
  }
  return "";
}

std::string OutcomeLedger::JudgeUnchanged(const Entry& entry, size_t d,
                                          const CommitOutcome& outcome) {
  const Volume* same = FindVolume(displays_[d], outcome.volume);
  if (same == nullptr || !same->shown.has_value()) {
    return absl::StrCat("UNCHANGED from volume ", outcome.volume, ", which was not shown");
  }
  for (const Volume& volume : displays_[d].volumes) {
    if (volume.snapshot < entry.commit.snapshot || !volume.picture.has_value()) continue;
    if (*volume.picture == *same->picture) return "";
    break;  // the first one drawn with it decides
  }
  // No volume was drawn for it: nothing had changed that an engine sees.
  for (auto it = pictures_.lower_bound(entry.commit.snapshot); it != pictures_.end(); ++it) {
    if (it->second == *same->picture) return "";
  }
  return absl::StrCat("UNCHANGED from volume ", outcome.volume, ", which looks otherwise");
}

std::string OutcomeLedger::JudgeSuperseded(size_t index, size_t d, const CommitOutcome& outcome) {
  const Commit& commit = commits_[index].commit;
  for (size_t i = index + 1; i < commits_.size(); ++i) {
    const Commit& by = commits_[i].commit;
    if (by.session != commit.session || by.sequence != outcome.by_sequence ||
        by.frame_id != outcome.by_frame_id) {
      continue;
    }
    if (commits_[i].on[d].not_shown.has_value()) return "SUPERSEDED by one that does not ride";
    if (SentBetween(displays_[d], commit.snapshot, by.snapshot, UINT64_MAX)) {
      return "SUPERSEDED by one that rode later: a volume with the first alone was sent";
    }
    return "";
  }
  return absl::StrCat("SUPERSEDED by no later commit of the session: sequence ",
                      outcome.by_sequence);
}

}  // namespace voxeld::daemon::model
