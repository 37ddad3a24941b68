#include "tools/voxelctl/connection/commit_ledger.h"

#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {

void CommitLedger::Sent(uint64_t frame_id, sync::TimeNs now) {
  open_[frame_id].sent = now;
  last_sent_ = frame_id;
  ++tally_.commits;
}

void CommitLedger::AddLatency(int64_t latency_ns) {
  if (latencies_ns_.size() < kMostLatencies) {
    latencies_ns_.push_back(latency_ns);
  } else {
    latencies_ns_[next_latency_++ % kMostLatencies] = latency_ns;
  }
}

void CommitLedger::Answered(const v1::Receipt& receipt, sync::TimeNs now) {
  const auto it = open_.find(receipt.frame_id());
  if (it == open_.end()) return;
  OpenCommit& commit = it->second;
  switch (receipt.what_case()) {
    case v1::Receipt::kAccepted:
      ++tally_.accepted;
      tally_.refused_operations += receipt.accepted().refused_operations();
      commit.accepted = true;
      commit.owed = static_cast<uint64_t>(receipt.accepted().displays_size());
      break;
    case v1::Receipt::kRefused:
      ++tally_.refused;
      tally_.refused_operations += receipt.refused().refused_operations();
      refusals_[receipt.frame_id()] = EscapeForTerminal(receipt.refused().message());
      if (refusals_.size() > kMostRefusals) refusals_.erase(refusals_.begin());
      open_.erase(it);
      return;
    case v1::Receipt::kOutcome: {
      const v1::Outcome& outcome = receipt.outcome();
      OutcomeCounts& counts = tally_.displays[outcome.display()];
      ++commit.outcomes;
      switch (outcome.what_case()) {
        case v1::Outcome::kPresented:
          ++counts.presented;
          AddLatency(now - commit.sent);
          break;
        case v1::Outcome::kUnchanged:
          ++counts.unchanged;
          break;
        case v1::Outcome::kSuperseded:
          ++counts.superseded;
          break;
        case v1::Outcome::kLost:
          ++counts.lost;
          counts.last_lost_reason = outcome.lost().reason();
          break;
        case v1::Outcome::kNotShown:
        case v1::Outcome::WHAT_NOT_SET:
          ++counts.not_shown;
          break;
      }
      break;
    }
    case v1::Receipt::kScheduled:
    case v1::Receipt::kDurable:
    case v1::Receipt::WHAT_NOT_SET:
      return;
  }
  if (commit.accepted && commit.outcomes >= commit.owed) open_.erase(it);
}

void CommitLedger::Told(const v1::Issue& issue) {
  ++tally_.issue_count;
  if (issue.reason() == v1::REASON_NOT_FOUND) ++tally_.not_found;
  if (tally_.issues.size() < SceneStream::kMostIssues) tally_.issues.push_back(issue);
}

bool CommitLedger::Accepted(uint64_t frame_id) const {
  if (refusals_.contains(frame_id) || frame_id > last_sent_) return false;
  const auto it = open_.find(frame_id);
  return it == open_.end() || it->second.accepted;
}

std::optional<std::string> CommitLedger::Refusal(uint64_t frame_id) const {
  const auto it = refusals_.find(frame_id);
  if (it == refusals_.end()) return std::nullopt;
  return it->second;
}

StreamTally CommitLedger::Tally() const {
  StreamTally tally = tally_;
  tally.unanswered = unanswered();
  return tally;
}

}  // namespace voxeld::voxelctl
