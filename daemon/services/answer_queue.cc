#include "daemon/services/answer_queue.h"

#include <utility>

#include "daemon/wire/encode.h"
#include "google/protobuf/arena.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::services {

size_t AnswerQueue::BytesOf(const Issue& issue) {
  return sizeof(Answer) + issue.layer.size() + issue.id.size() + issue.field.size() +
         issue.message.size();
}

size_t AnswerQueue::BytesOf(const Receipt& receipt) {
  size_t bytes = sizeof(Answer);
  if (const auto* accepted = std::get_if<Accepted>(&receipt.what)) {
    for (const std::string& name : accepted->displays) bytes += sizeof(name) + name.size();
  } else if (const auto* refused = std::get_if<Refused>(&receipt.what)) {
    bytes += refused->message.size();
  } else if (const auto* outcome = std::get_if<CommitOutcome>(&receipt.what)) {
    bytes += outcome->display.size() + outcome->reason.size();
  }
  return bytes;
}

template <typename T>
bool AnswerQueue::AddAnswer(T answer) {
  const size_t bytes = BytesOf(answer);
  if (bytes_ + bytes <= kAlwaysBytes) {
    budget_->ChargeAnyway(Budget::Use::kAnswers, bytes);
  } else if (!budget_->Charge(Budget::Use::kAnswers, bytes)) {
    return false;
  }
  bytes_ += bytes;
  answers_.emplace_back(std::move(answer));
  return true;
}

bool AnswerQueue::Add(Issue issue) { return AddAnswer(std::move(issue)); }
bool AnswerQueue::Add(Receipt receipt) { return AddAnswer(std::move(receipt)); }

void AnswerQueue::AddPong(int64_t client_time_ns, sync::TimeNs received_ns) {
  if (pongs_.size() < kMostPongs) pongs_.push_back({client_time_ns, received_ns});
}

void AnswerQueue::PopFront() {
  const size_t bytes =
      std::visit([](const auto& answer) { return BytesOf(answer); }, answers_.front());
  answers_.pop_front();
  bytes_ -= bytes;
  budget_->Release(Budget::Use::kAnswers, bytes);
}

std::string AnswerQueue::Pop(sync::TimeNs now) {
  if (opened_.has_value()) return *std::exchange(opened_, std::nullopt);
  google::protobuf::Arena arena;
  auto* message = google::protobuf::Arena::CreateMessage<v1::StreamResponse>(&arena);
  for (size_t bytes = 0; !answers_.empty() && bytes < kMessageBytes;) {
    const Answer& answer = answers_.front();
    if (const auto* issue = std::get_if<Issue>(&answer)) {
      wire::Encode(*issue, message->add_issues());
      bytes += BytesOf(*issue);
    } else {
      const Receipt& receipt = std::get<Receipt>(answer);
      wire::Encode(receipt, message->add_receipts());
      bytes += BytesOf(receipt);
      if (IsOwed(receipt)) popped_.push_back(receipt);
    }
    PopFront();
  }
  message->set_credit_bytes(std::exchange(credit_, 0));
  if (!pongs_.empty()) {
    message->mutable_pong()->set_client_time_ns(pongs_.front().client_time_ns);
    message->mutable_pong()->set_received_time_ns(pongs_.front().received_ns);
    message->mutable_pong()->set_server_time_ns(now);
    pongs_.pop_front();
  }
  message->set_server_time_ns(now);
  return message->SerializeAsString();
}

std::vector<Receipt> AnswerQueue::TakeOutcomes() {
  std::vector<Receipt> outcomes = std::exchange(popped_, {});
  while (!answers_.empty()) {
    if (auto* receipt = std::get_if<Receipt>(&answers_.front());
        receipt != nullptr && IsOwed(*receipt)) {
      outcomes.push_back(*receipt);
    }
    PopFront();
  }
  Clear();
  return outcomes;
}

void AnswerQueue::Clear() {
  while (!answers_.empty()) PopFront();
  popped_.clear();
  opened_.reset();
  pongs_.clear();
  credit_ = 0;
}

}  // namespace voxeld::daemon::services
