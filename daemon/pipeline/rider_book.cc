#include "daemon/pipeline/rider_book.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {

RiderBook::RiderBook(std::string display, Tell tell)
    : display_(std::move(display)), tell_(std::move(tell)) {}

uint64_t RiderBook::pending() const {
  uint64_t pending = waiting_.size() + drawing_.size();
  for (const auto& [number, volume] : submitted_) {
    pending += volume.riders.size() + volume.unchanged.size();
  }
  return pending;
}

void RiderBook::Give(const Rider& rider, CommitOutcome outcome) {
  switch (outcome.kind) {
    case CommitOutcome::Kind::kPresented:
      ++counts_.presented;
      break;
    case CommitOutcome::Kind::kUnchanged:
      ++counts_.unchanged;
      break;
    case CommitOutcome::Kind::kSuperseded:
      ++counts_.superseded;
      break;
    case CommitOutcome::Kind::kLost:
      ++counts_.lost;
      break;
    case CommitOutcome::Kind::kNotShown:
      ++counts_.not_shown;
      break;
  }
  outcome.display = display_;
  tell_(rider, outcome);
}

void RiderBook::Lose(std::vector<Rider>& riders, const std::string& reason) {
  for (const Rider& rider : std::exchange(riders, {})) {
    CommitOutcome outcome;
    outcome.kind = CommitOutcome::Kind::kLost;
    outcome.reason = reason;
    Give(rider, std::move(outcome));
  }
}

void RiderBook::Merge(std::vector<Rider>& riders, const std::vector<Rider>& later) {
  for (const Rider& rider : later) {
    const auto earlier = std::find_if(riders.begin(), riders.end(),
                                      [&](const Rider& r) { return r.session == rider.session; });
    if (earlier != riders.end()) {
      CommitOutcome outcome;
      outcome.kind = CommitOutcome::Kind::kSuperseded;
      outcome.by_frame_id = rider.frame_id;
      outcome.by_sequence = rider.sequence;
      Give(*earlier, std::move(outcome));
      riders.erase(earlier);
    }
    riders.push_back(rider);
  }
}

void RiderBook::Board(const Rider& rider) {
  ++counts_.owed;
  waiting_.push_back(rider);
}

void RiderBook::NotShown(const Rider& rider, CommitOutcome::NotShown why) {
  ++counts_.owed;
  CommitOutcome outcome;
  outcome.kind = CommitOutcome::Kind::kNotShown;
  outcome.why = why;
  Give(rider, std::move(outcome));
}

void RiderBook::Draw(uint64_t snapshot, const std::map<uint64_t, uint64_t>& held) {
  const auto later = std::stable_partition(waiting_.begin(), waiting_.end(), [&](const Rider& r) {
    const auto part = held.find(r.owner);
    return r.snapshot <= (part == held.end() ? snapshot : part->second);
  });
  const std::vector<Rider> aboard(waiting_.begin(), later);
  waiting_.erase(waiting_.begin(), later);
  Merge(drawing_, aboard);
}

void RiderBook::Reboard(uint64_t volume) {
  const auto node = submitted_.extract(volume);
  if (node.empty()) return;
  const Volume& lost = node.mapped();
  waiting_.insert(waiting_.begin(), lost.unchanged.begin(), lost.unchanged.end());
  waiting_.insert(waiting_.begin(), lost.riders.begin(), lost.riders.end());
}

void RiderBook::Redraw() {
  waiting_.insert(waiting_.begin(), drawing_.begin(), drawing_.end());
  drawing_.clear();
}

void RiderBook::Submit(uint64_t volume, const Stages& drawn) {
  submitted_[volume] = {std::exchange(drawing_, {}), {}, drawn};
}

void RiderBook::Unchanged(uint64_t before) {
  const auto it = submitted_.find(before);
  if (it != submitted_.end()) {
    it->second.unchanged.insert(it->second.unchanged.end(), drawing_.begin(), drawing_.end());
    drawing_.clear();
    return;
  }
  for (const Rider& rider : std::exchange(drawing_, {})) {
    CommitOutcome outcome;
    outcome.kind = CommitOutcome::Kind::kUnchanged;
    outcome.volume = before;
    Give(rider, std::move(outcome));
  }
}

void RiderBook::LoseUnsubmitted(const std::string& reason, bool waiting) {
  Lose(drawing_, reason);
  if (waiting) Lose(waiting_, reason);
}

void RiderBook::HideWaiting() {
  for (const Rider& rider : std::exchange(waiting_, {})) {
    CommitOutcome outcome;
    outcome.kind = CommitOutcome::Kind::kNotShown;
    outcome.why = CommitOutcome::NotShown::kHidden;
    Give(rider, std::move(outcome));
  }
}

void RiderBook::OnOutcome(const display::VolumeOutcome& outcome) {
  const auto it = submitted_.find(outcome.volume);
  if (it == submitted_.end()) return;
  Volume volume = std::move(it->second);
  submitted_.erase(it);

  switch (outcome.kind) {
    case display::VolumeOutcome::Kind::kPresented: {
      CommitOutcome given;
      given.kind = CommitOutcome::Kind::kPresented;
      given.volume = outcome.volume;
      given.time_ns = outcome.time_ns;
      given.evidence = outcome.evidence;
      given.last_byte_ns = outcome.last_byte_ns;
      for (const Rider& rider : volume.riders) {
        given.stages = rider.stages;
        given.stages.drawing_ns = volume.drawn.drawing_ns;
        given.stages.assembled_ns = volume.drawn.assembled_ns;
        given.stages.sliced_ns = volume.drawn.sliced_ns;
        given.stages.transferred_ns = outcome.last_byte_ns;
        given.stages.shown_ns = outcome.time_ns;
        Give(rider, given);
      }
      given = {};
      given.kind = CommitOutcome::Kind::kUnchanged;
      given.volume = outcome.volume;
      for (const Rider& rider : volume.unchanged) Give(rider, given);
      break;
    }
    case display::VolumeOutcome::Kind::kLost:
      Lose(volume.riders, outcome.reason);
      Lose(volume.unchanged, outcome.reason);
      break;
    case display::VolumeOutcome::Kind::kReplaced: {
      const auto next = submitted_.find(outcome.replaced_by);
      if (next == submitted_.end()) {
        const std::string reason =
            absl::StrCat("replaced by volume ", outcome.replaced_by, ", which has ended already");
        Lose(volume.riders, reason);
        Lose(volume.unchanged, reason);
        break;
      }
      std::vector<Rider> riders = std::move(volume.riders);
      Merge(riders, volume.unchanged);
      Merge(riders, next->second.riders);
      next->second.riders = std::move(riders);
      break;
    }
  }
}

}  // namespace voxeld::daemon
