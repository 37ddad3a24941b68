#include "client/cpp/src/receipt_book.h"

#include <algorithm>
#include <utility>

#include "client/cpp/src/from_wire.h"

namespace voxeld::client {

namespace {

constexpr std::string_view kUnheard =
    "the answer was lost with its connection; the server applied it or refused it whole";

}  // namespace

void ReceiptBook::Queued(uint64_t frame) {
  entries_[frame].receipt.frame = frame;
  unsettled_.insert(frame);
  changed_.insert(frame);
  ++tally_.commits;
}

ReceiptBook::Entry* ReceiptBook::Open(uint64_t frame) {
  const auto it = entries_.find(frame);
  if (it == entries_.end() || it->second.receipt.settled) return nullptr;
  return &it->second;
}

void ReceiptBook::Sent(uint64_t frame, uint64_t first_sequence, uint64_t commit_sequence,
                       int64_t now_ns) {
  Entry* entry = Open(frame);
  if (entry == nullptr) return;
  by_commit_sequence_.erase(entry->commit_sequence);
  entry->first_sequence = first_sequence;
  entry->commit_sequence = commit_sequence;
  entry->sent_ns = now_ns;
  entry->receipt.state = Receipt::State::kSent;
  // Discard what was reported about an earlier sending.
  entry->receipt.outcomes.clear();
  std::erase_if(entry->receipt.issues,
                [&](const Issue& issue) { return issue.sequence < first_sequence; });
  ++entry->receipt.sendings;
  by_commit_sequence_[commit_sequence] = frame;
  changed_.insert(frame);
}

void ReceiptBook::Dropped(uint64_t frame, uint64_t frames, bool whole) {
  tally_.client_dropped_frames += frames;
  Entry* entry = Open(frame);
  if (entry == nullptr) return;
  entry->receipt.client_dropped_frames += frames;
  changed_.insert(frame);
  if (!whole) return;
  entry->receipt.state = Receipt::State::kDropped;
  ++tally_.dropped;
  Settle(entry);
}

void ReceiptBook::StreamLost() {
  for (const uint64_t frame : unsettled_) {
    Entry& entry = entries_.at(frame);
    Receipt& receipt = entry.receipt;
    const bool waits_for_answer =
        receipt.state == Receipt::State::kSent || receipt.state == Receipt::State::kScheduled;
    if (!waits_for_answer || entry.unheard) continue;
    receipt.state = Receipt::State::kQueued;
    changed_.insert(frame);
  }
}

void ReceiptBook::Settle(Entry* entry) {
  const uint64_t frame = entry->receipt.frame;
  entry->receipt.settled = true;
  changed_.insert(frame);
  unsettled_.erase(frame);
  by_commit_sequence_.erase(entry->commit_sequence);
  settled_.insert(frame);
  // A change that has not been delivered yet keeps its receipt.
  while (settled_.size() > kMostSettled && !changed_.contains(*settled_.begin())) {
    entries_.erase(*settled_.begin());
    settled_.erase(settled_.begin());
  }
}

void ReceiptBook::SettleIfComplete(Entry* entry) {
  const Receipt& receipt = entry->receipt;
  if (receipt.state == Receipt::State::kAccepted &&
      (!outcomes_ || receipt.outcomes.size() >= receipt.displays.size()) &&
      (!receipt.durable_owed || receipt.durable)) {
    Settle(entry);
  }
}

void ReceiptBook::TellOutcome(const v1::Outcome& wire, int64_t now_ns, Entry* entry) {
  Outcome outcome = FromWire(wire);
  OutcomeCounts& counts = tally_.displays[outcome.display];
  if (entry != nullptr) outcome.latency_ns = now_ns - entry->sent_ns;
  switch (outcome.kind) {
    case Outcome::Kind::kPresented:
      ++counts.presented;
      if (entry == nullptr) break;
      if (latencies_ns_.size() < kMostLatencies) {
        latencies_ns_.push_back(outcome.latency_ns);
      } else {
        latencies_ns_[next_latency_++ % kMostLatencies] = outcome.latency_ns;
      }
      break;
    case Outcome::Kind::kUnchanged:
      ++counts.unchanged;
      break;
    case Outcome::Kind::kSuperseded:
      ++counts.superseded;
      break;
    case Outcome::Kind::kLost:
      ++counts.lost;
      counts.last_lost_reason = outcome.reason;
      break;
    case Outcome::Kind::kNotShown:
      ++counts.not_shown;
      break;
  }
  if (entry == nullptr) return;
  if (std::exchange(entry->unheard, false)) TakeAsAccepted(entry);
  entry->receipt.outcomes.push_back(std::move(outcome));
}

void ReceiptBook::Told(const v1::Receipt& wire, int64_t now_ns) {
  Entry* entry = Open(wire.frame_id());
  if (entry == nullptr) {
    // The commit is already settled, as can happen after a resume: count its outcome in the totals
    // only.
    if (wire.has_outcome() && entries_.contains(wire.frame_id()))
      TellOutcome(wire.outcome(), now_ns, nullptr);
    return;
  }
  Receipt& receipt = entry->receipt;
  // The commit was sent again since: the outcome of the earlier sending does not count.
  const bool of_another_sending =
      receipt.state == Receipt::State::kQueued ||
      (wire.sequence() != 0 && wire.sequence() != entry->commit_sequence);
  if (wire.has_outcome() && of_another_sending) {
    TellOutcome(wire.outcome(), now_ns, nullptr);
    return;
  }
  changed_.insert(receipt.frame);
  switch (wire.what_case()) {
    case v1::Receipt::kAccepted: {
      const v1::Accepted& accepted = wire.accepted();
      receipt.state = Receipt::State::kAccepted;
      receipt.snapshot = accepted.snapshot();
      receipt.refused_operations = accepted.refused_operations();
      receipt.applied_time_ns = accepted.applied_time_ns();
      receipt.late = accepted.late();
      receipt.durable_owed = accepted.durable();
      receipt.dropped_frames = accepted.dropped_frames();
      receipt.stages = FromWire(accepted.stages());
      receipt.displays.assign(accepted.displays().begin(), accepted.displays().end());
      entry->accepted_ns = now_ns;
      ++tally_.accepted;
      tally_.refused_operations += accepted.refused_operations();
      tally_.server_dropped_frames += accepted.dropped_frames();
      break;
    }
    case v1::Receipt::kRefused:
      receipt.state = Receipt::State::kRefused;
      receipt.message = wire.refused().message();
      receipt.refused_operations = wire.refused().refused_operations();
      ++tally_.refused;
      tally_.refused_operations += wire.refused().refused_operations();
      Settle(entry);
      return;
    case v1::Receipt::kScheduled:
      receipt.state = Receipt::State::kScheduled;
      receipt.present_at_ns = wire.scheduled().present_at_ns();
      return;
    case v1::Receipt::kOutcome:
      TellOutcome(wire.outcome(), now_ns, entry);
      break;
    case v1::Receipt::kDurable:
      receipt.durable = true;
      break;
    case v1::Receipt::WHAT_NOT_SET:
      return;
  }
  SettleIfComplete(entry);
}

const Issue& ReceiptBook::Told(const v1::Issue& wire, uint64_t frame) {
  last_issue_ = FromWire(wire);
  ++tally_.issue_count;
  if (last_issue_.reason == Reason::kNotFound) ++tally_.not_found;
  Entry* entry = Open(frame);
  const auto it = by_commit_sequence_.lower_bound(last_issue_.sequence);
  if (it != by_commit_sequence_.end()) {
    Entry& sent = entries_.at(it->second);
    if (last_issue_.sequence >= sent.first_sequence) entry = &sent;
  }
  if (entry != nullptr) {
    last_issue_.frame = entry->receipt.frame;
    if (entry->receipt.issues.size() < kMostIssuesOfCommit)
      entry->receipt.issues.push_back(last_issue_);
    changed_.insert(last_issue_.frame);
  }
  if (tally_.issues.size() < kMostIssues) tally_.issues.push_back(last_issue_);
  return last_issue_;
}

void ReceiptBook::TakeAsAccepted(Entry* entry) {
  entry->receipt.state = Receipt::State::kAccepted;
  entry->receipt.message = "applied; the answer that said so was lost with its connection";
  entry->accepted_ns = INT64_MIN;  // on an earlier stream, at an unknown time
  ++tally_.accepted;
  changed_.insert(entry->receipt.frame);
}

void ReceiptBook::Applied(uint64_t frame, const std::vector<std::string>& displays) {
  Entry* entry = Open(frame);
  if (entry == nullptr) return;
  TakeAsAccepted(entry);
  if (outcomes_) entry->receipt.displays = displays;
  SettleIfComplete(entry);
}

void ReceiptBook::Unheard(uint64_t frame, const std::vector<std::string>& displays) {
  Entry* entry = Open(frame);
  if (entry == nullptr) return;
  entry->receipt.state = Receipt::State::kSent;
  if (!outcomes_ || displays.empty()) return Lost(frame, std::string(kUnheard));
  entry->unheard = true;
  entry->receipt.displays = displays;
  changed_.insert(frame);
}

void ReceiptBook::RefusedHere(uint64_t frame, const std::string& why) {
  Entry* entry = Open(frame);
  if (entry == nullptr) return;
  entry->receipt.state = Receipt::State::kRefused;
  entry->receipt.message = why;
  ++tally_.refused;
  Settle(entry);
}

void ReceiptBook::Lost(uint64_t frame, const std::string& why) {
  Entry* entry = Open(frame);
  if (entry == nullptr) return;
  if (entry->receipt.state == Receipt::State::kAccepted) {
    for (const std::string& display : entry->receipt.displays) {
      const auto told =
          std::find_if(entry->receipt.outcomes.begin(), entry->receipt.outcomes.end(),
                       [&](const Outcome& outcome) { return outcome.display == display; });
      if (told != entry->receipt.outcomes.end()) continue;
      Outcome outcome;
      outcome.display = display;
      outcome.reason = why;
      entry->receipt.outcomes.push_back(std::move(outcome));
      OutcomeCounts& counts = tally_.displays[display];
      ++counts.lost;
      counts.last_lost_reason = why;
    }
  } else {
    entry->receipt.state = Receipt::State::kLost;
    entry->receipt.message = why;
    ++tally_.lost;
  }
  Settle(entry);
}

uint64_t ReceiptBook::OutcomesLost(int64_t accepted_before_ns, const std::string& why) {
  uint64_t count = 0;
  const std::set<uint64_t> unsettled = unsettled_;
  for (const uint64_t frame : unsettled) {
    const Entry& entry = entries_.at(frame);
    const bool accepted =
        entry.receipt.state == Receipt::State::kAccepted && entry.accepted_ns < accepted_before_ns;
    if (!accepted && !entry.unheard) continue;
    Lost(frame, entry.unheard ? std::string(kUnheard) : why);
    ++count;
  }
  return count;
}

void ReceiptBook::Ended(const std::string& why) {
  const std::set<uint64_t> unsettled = unsettled_;
  for (const uint64_t frame : unsettled) {
    if (entries_.at(frame).receipt.state != Receipt::State::kAccepted) Lost(frame, why);
  }
}

const Receipt* ReceiptBook::Find(uint64_t frame) const {
  const auto it = entries_.find(frame);
  return it == entries_.end() ? nullptr : &it->second.receipt;
}

std::vector<uint64_t> ReceiptBook::TakeChanged() {
  std::vector<uint64_t> changed(changed_.begin(), changed_.end());
  changed_.clear();
  return changed;
}

Tally ReceiptBook::GetTally() const {
  Tally tally = tally_;
  tally.unsettled = unsettled_.size();
  return tally;
}

}  // namespace voxeld::client
