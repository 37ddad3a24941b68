// What one stream's client is to be told and has not been sent: issues, receipts, credit, pongs. What waits together
// goes in one message.
//
// Single-threaded; charges the budget for what it holds.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "daemon/core/budget.h"
#include "daemon/core/receipt.h"
#include "daemon/scene/operation.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::services {

class AnswerQueue {
 public:
  explicit AnswerQueue(std::shared_ptr<Budget> budget) : budget_(std::move(budget)) {}
  ~AnswerQueue() { Clear(); }
  AnswerQueue(const AnswerQueue&) = delete;
  AnswerQueue& operator=(const AnswerQueue&) = delete;

  // A serialised StreamResponse with nothing but Opened; it goes alone and first.
  void AddOpened(std::string message) { opened_ = std::move(message); }
  // False: the budget is used up, much waits here already, and the answer is dropped.
  [[nodiscard]] bool Add(Issue issue);
  [[nodiscard]] bool Add(Receipt receipt);
  // Replaces what was there before: both only grow, or are asked for anew.
  void SetCredit(uint64_t total_bytes) { credit_ = total_bytes; }
  // Of one Ping each; the first kMostPongs that wait.
  void AddPong(int64_t client_time_ns, sync::TimeNs received_ns);

  bool empty() const { return answers_.empty() && !opened_ && credit_ == 0 && pongs_.empty(); }
  size_t size() const { return answers_.size(); }  // issues and receipts
  size_t bytes() const { return bytes_; }          // that they hold here

  // The next message, serialised, of about kMessageBytes at most; the queue is not empty, and what was popped before
  // has been written. `now` becomes its server time.
  std::string Pop(sync::TimeNs now);
  // What was popped is on its way.
  void Written() { popped_.clear(); }
  // Nobody will be told: the outcomes among what waits or was popped and not written, in order; the
  // rest goes.
  std::vector<Receipt> TakeOutcomes();
  void Clear();

 private:
  static constexpr size_t kMessageBytes = 64u << 10;
  static constexpr size_t kMostPongs = 16;
  // A client that reads is told, whatever others have used up.
  static constexpr size_t kAlwaysBytes = 64u << 10;
  using Answer = std::variant<Issue, Receipt>;
  struct PongDue {
    int64_t client_time_ns = 0;
    sync::TimeNs received_ns = 0;
  };

  static size_t BytesOf(const Issue& issue);
  static size_t BytesOf(const Receipt& receipt);
  template <typename T>
  bool AddAnswer(T answer);
  void PopFront();

  const std::shared_ptr<Budget> budget_;
  std::optional<std::string> opened_;
  std::deque<Answer> answers_;
  std::vector<Receipt> popped_;  // outcomes
  std::deque<PongDue> pongs_;
  uint64_t credit_ = 0;
  size_t bytes_ = 0;
};

}  // namespace voxeld::daemon::services
