// The book of one stream's commits: what was sent, what was answered, what is still owed.
// Knows no gRPC.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "display/sync/clock.h"
#include "tools/voxelctl/connection/scene_stream.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

// Not thread-safe.
class CommitLedger {
 public:
  static constexpr size_t kMostLatencies = 65536;
  static constexpr size_t kMostRefusals = 1024;  // whose words are kept: the newest

  void Sent(uint64_t frame_id, sync::TimeNs now);
  // Answers about commits that it does not know are ignored.
  void Answered(const v1::Receipt& receipt, sync::TimeNs now);
  void Told(const v1::Issue& issue);

  // Sent, and not yet refused or accepted with every outcome.
  uint64_t unanswered() const { return open_.size(); }
  bool Settled(uint64_t frame_id) const { return !open_.contains(frame_id); }
  bool Accepted(uint64_t frame_id) const;
  // The server's words, if the commit was refused.
  std::optional<std::string> Refusal(uint64_t frame_id) const;

  StreamTally Tally() const;
  const std::vector<int64_t>& latencies_ns() const { return latencies_ns_; }

 private:
  struct OpenCommit {
    sync::TimeNs sent = 0;
    bool accepted = false;
    uint64_t owed = 0;      // outcomes that Accepted announced
    uint64_t outcomes = 0;  // that came, in whatever order
  };
  void AddLatency(int64_t latency_ns);

  std::map<uint64_t, OpenCommit> open_;
  std::map<uint64_t, std::string> refusals_;
  uint64_t last_sent_ = 0;
  size_t next_latency_ = 0;
  std::vector<int64_t> latencies_ns_;
  StreamTally tally_;
};

}  // namespace voxeld::voxelctl
