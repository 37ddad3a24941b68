// Records all commits: what was requested, answered, and is still pending. Does not depend on gRPC.
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
  // the newest settled commits, whose receipts are kept
  static constexpr size_t kMostSettled = 1024;
  static constexpr size_t kMostLatencies = 65536;
  static constexpr size_t kMostIssues = 20;           // in the tally
  static constexpr size_t kMostIssuesOfCommit = 100;  // in one receipt

  explicit ReceiptBook(bool outcomes) : outcomes_(outcomes) {}

  void Queued(uint64_t frame);
  // The commit's requests had the sequences from `first_sequence` on; its Commit had the last.
  void Sent(uint64_t frame, uint64_t first_sequence, uint64_t commit_sequence, int64_t now_ns);
  // Frames of the commit were dropped by the client; `whole`: and with them the entire commit.
  void Dropped(uint64_t frame, uint64_t frames, bool whole);
  // All sent but unanswered commits wait again.
  void StreamLost();

  // Records a receipt. For unknown commits only the totals are updated.
  void Told(const v1::Receipt& receipt, int64_t now_ns);
  // `frame`: the commit that the issue belongs to, if that is still being sent; 0: unknown.
  const Issue& Told(const v1::Issue& issue, uint64_t frame = 0);

  // The commit was applied, and its answer is lost; the outcomes of `displays` are still pending.
  void Applied(uint64_t frame, const std::vector<std::string>& displays);
  // The commit was applied or refused, and the answer that said which is lost. An outcome will show
  // that it was applied; OutcomesLost ends the waiting.
  void Unheard(uint64_t frame, const std::vector<std::string>& displays);
  // The commit was not sent, because the server would reject it.
  void RefusedHere(uint64_t frame, const std::string& why);
  // No answer to the commit will come.
  void Lost(uint64_t frame, const std::string& why);
  // No outcomes will come for commits accepted before `accepted_before_ns`, or whose answer was
  // lost. Returns the number of those commits.
  uint64_t OutcomesLost(int64_t accepted_before_ns, const std::string& why);
  // No more answers will come at all. Accepted commits keep the outcomes that they have.
  void Ended(const std::string& why);

  const Receipt* Find(uint64_t frame) const;
  uint64_t unsettled() const { return unsettled_.size(); }
  size_t changed() const { return changed_.size(); }
  // Returns the frames whose receipts changed since the last call, ascending.
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
  std::set<uint64_t> settled_;                       // kept for queries
  std::map<uint64_t, uint64_t> by_commit_sequence_;  // of unsettled commits → frame
  std::set<uint64_t> changed_;
  Issue last_issue_;
  Tally tally_;
  size_t next_latency_ = 0;
  std::vector<int64_t> latencies_ns_;
};

}  // namespace voxeld::client
