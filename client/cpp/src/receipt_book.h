// The book of all commits: what was asked for, what was answered, what is owed. Knows no gRPC.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "voxeld/receipt.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {

class ReceiptBook {
 public:
  static constexpr size_t kMostSettled = 1024;  // whose receipts are kept: the newest
  static constexpr size_t kMostLatencies = 65536;
  static constexpr size_t kMostIssues = 20;           // of the tally
  static constexpr size_t kMostIssuesOfCommit = 100;  // of one receipt

  explicit ReceiptBook(bool outcomes) : outcomes_(outcomes) {}

  void Queued(uint64_t frame);
  // Its requests had these sequences, the Commit's last.
  void Sent(uint64_t frame, uint64_t first_sequence, uint64_t commit_sequence, int64_t now_ns);
  // Frames of it were given up here; `whole`: and with them the commit.
  void Dropped(uint64_t frame, uint64_t frames, bool whole);
  // All that was sent and not answered waits again.
  void StreamLost();

  // Of what it does not know, only the sums are kept.
  void Told(const v1::Receipt& receipt, int64_t now_ns);
  // `frame`: the commit that it is of, if that is being sent; 0: not known.
  const Issue& Told(const v1::Issue& issue, uint64_t frame = 0);

  // It was applied, and the answer that said so is lost; the outcomes of `displays` are still owed.
  void Applied(uint64_t frame, const std::vector<std::string>& displays);
  // It was applied or refused, and the answer that said which is lost. An outcome will tell that it was
  // applied; OutcomesLost ends the waiting.
  void Unheard(uint64_t frame, const std::vector<std::string>& displays);
  // It was not sent, because the server would not take it.
  void RefusedHere(uint64_t frame, const std::string& why);
  // No answer will come.
  void Lost(uint64_t frame, const std::string& why);
  // Outcomes of what had been accepted before `accepted_before_ns`, or was not heard of, will not come. How many
  // commits.
  uint64_t OutcomesLost(int64_t accepted_before_ns, const std::string& why);
  // No answer will come to anything. What was accepted keeps what it has.
  void Ended(const std::string& why);

  const Receipt* Find(uint64_t frame) const;
  uint64_t unsettled() const { return unsettled_.size(); }
  size_t changed() const { return changed_.size(); }
  // Frames whose receipts changed since the last call, ascending.
  std::vector<uint64_t> TakeChanged();

  Tally GetTally() const;
  Tally& tally() { return tally_; }
  const std::vector<int64_t>& latencies_ns() const { return latencies_ns_; }

 private:
  struct Entry {
    Receipt receipt;
    uint64_t first_sequence = 0, commit_sequence = 0;
    int64_t sent_ns = 0, accepted_ns = 0;
    bool unheard = false;
  };
  Entry* Open(uint64_t frame);
  void Settle(Entry* entry);
  void SettleIfComplete(Entry* entry);
  void TakeAsAccepted(Entry* entry);
  void TellOutcome(const v1::Outcome& outcome, int64_t now_ns, Entry* entry);

  const bool outcomes_;
  std::map<uint64_t, Entry> entries_;
  std::set<uint64_t> unsettled_;
  std::set<uint64_t> settled_;                       // kept for who asks
  std::map<uint64_t, uint64_t> by_commit_sequence_;  // of the unsettled → frame
  std::set<uint64_t> changed_;
  Issue last_issue_;
  Tally tally_;
  size_t next_latency_ = 0;
  std::vector<int64_t> latencies_ns_;
};

}  // namespace voxeld::client
