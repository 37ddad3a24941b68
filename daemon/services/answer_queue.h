// The messages that one stream's client has not been sent yet: issues, receipts, credit and pongs.
// Everything queued is combined into one message.
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

  // `message` is a serialized StreamResponse with nothing but Opened. It is sent alone and first.
  void AddOpened(std::string message) { opened_ = std::move(message); }
  // Returns: false, dropping the answer, if the budget is exhausted and much is queued here.
  [[nodiscard]] bool Add(Issue issue);
  [[nodiscard]] bool Add(Receipt receipt);
  // Replaces the previous credit; the total only grows.
  void SetCredit(uint64_t total_bytes) { credit_ = total_bytes; }
  // Adds the answer to a Ping; at most kMostPongs are queued.
  void AddPong(int64_t client_time_ns, sync::TimeNs received_ns);

  bool empty() const { return answers_.empty() && !opened_ && credit_ == 0 && pongs_.empty(); }
  size_t size() const { return answers_.size(); }  // issues and receipts
  size_t bytes() const { return bytes_; }          // used by these in the queue

  // Returns: the next serialized message, at most about kMessageBytes. Requires: the queue is not
  // empty, and the last message has been written. `now` becomes its server time.
  std::string Pop(sync::TimeNs now);
  // The last message has been written.
  void Written() { popped_.clear(); }
  // Call when nothing more will be sent. Returns: in order, the outcomes that are queued or were
  // popped but not written; drops the rest.
  std::vector<Receipt> TakeOutcomes();
  void Clear();

 private:
  static constexpr size_t kMessageBytes = 64u << 10;
  static constexpr size_t kMostPongs = 16;
  // A client that reads may always queue this much, regardless of the budget.
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
