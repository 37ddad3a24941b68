#include "display/usb/faulty_transport.h"

#include <algorithm>
#include <utility>

namespace voxeld::display {
namespace {

using Where = TransportFault::Where;

uint8_t QueueOf(TransferType type, uint8_t endpoint) {
  return type == TransferType::kControl ? 0 : endpoint;
}

void Falsify(const TransportFault& fault, bool in, TransferCompletion& completion) {
  if (fault.status.has_value()) {
    completion.status = *fault.status;
    const bool brings =
        *fault.status == TransferStatus::kOk || *fault.status == TransferStatus::kShort;
    if (!brings) completion.actual_length = 0;
  }
  if (fault.actual_length.has_value()) completion.actual_length = *fault.actual_length;
  if (!in) return;
  completion.actual_length =
      std::min(completion.actual_length, static_cast<uint32_t>(completion.data.size()));
  completion.data.resize(completion.actual_length);
}

}  // namespace

FaultyTransport::FaultyTransport(std::unique_ptr<UsbTransport> inner,
                                 std::vector<TransportFault> plan, sync::Clock& clock,
                                 Options options)
    : inner_(std::move(inner)), plan_(std::move(plan)), clock_(clock) {
  if (options.own_thread) thread_ = std::thread([this] { Run(); });
}

FaultyTransport::~FaultyTransport() {
  if (!thread_.joinable()) return;
  {
    sync::MutexLock lock(mutex_);
    stop_ = true;
    work_.NotifyAll();
  }
  thread_.join();
}

const TransportFault* FaultyTransport::Meet(Where where, uint64_t count) {
  for (const TransportFault& fault : plan_) {
    if (fault.where == where && count >= fault.at && count - fault.at < fault.count) {
      ++hits_;
      return &fault;
    }
  }
  return nullptr;
}

absl::Status FaultyTransport::Open() {
  if (const TransportFault* const fault = Meet(Where::kOpen, ++opens_)) return fault->refusal;
  return inner_->Open();
}

void FaultyTransport::Close() {
  inner_->Close();
  gone_ = false;
  in_flight_.clear();
  held_.clear();
  sync::MutexLock lock(mutex_);
  next_due_ = sync::kNever;
}

absl::Status FaultyTransport::Refusal() {
  if (!inner_->is_open()) return absl::OkStatus();  // the inner transport refuses by itself
  if (gone_) return absl::UnavailableError("the device was unplugged");
  const TransportFault* const fault = Meet(Where::kSubmit, ++submits_);
  return fault == nullptr ? absl::OkStatus() : fault->refusal;
}

absl::StatusOr<TransferId> FaultyTransport::Note(const InFlight& in_flight,
                                                 absl::StatusOr<TransferId> id) {
  if (id.ok()) in_flight_.emplace(*id, in_flight);
  return id;
}

absl::StatusOr<TransferId> FaultyTransport::Submit(Transfer&& transfer) {
  absl::Status refusal = Refusal();
  if (!refusal.ok()) return refusal;
  const bool control = transfer.type == TransferType::kControl;
  const InFlight in_flight{transfer.type,
                           control ? transfer.setup.request_type : transfer.endpoint};
  return Note(in_flight, inner_->Submit(std::move(transfer)));
}

absl::StatusOr<TransferId> FaultyTransport::ClearHalt(uint8_t endpoint) {
  absl::Status refusal = Refusal();
  if (!refusal.ok()) return refusal;
  return Note({TransferType::kControl, 0}, inner_->ClearHalt(endpoint));
}

absl::StatusOr<TransferId> FaultyTransport::Reset() {
  absl::Status refusal = Refusal();
  if (!refusal.ok()) return refusal;
  return Note({TransferType::kControl, 0}, inner_->Reset());
}

void FaultyTransport::Take(TransferCompletion completion, std::vector<TransferCompletion>& out) {
  const auto it = in_flight_.find(completion.id);
  if (it == in_flight_.end()) return;  // already ended with the device
  const bool in = (it->second.endpoint & 0x80) != 0;
  const TransportFault* const fault = Meet(Where::kCompletion, ++completions_);
  std::deque<Held>& queue = held_[QueueOf(completion.type, completion.endpoint)];
  if (fault != nullptr) Falsify(*fault, in, completion);
  if ((fault != nullptr && fault->hold > 0) || !queue.empty()) {
    const sync::TimeNs due = fault == nullptr ? 0 : clock_.Now() + fault->hold;
    queue.push_back({queue.empty() ? due : std::max(due, queue.back().due), std::move(completion)});
    return;
  }
  in_flight_.erase(it);
  const bool disconnected = completion.status == TransferStatus::kDisconnected;
  out.push_back(std::move(completion));
  if (!disconnected || fault == nullptr) return;
  gone_ = true;
  held_.clear();
  for (const auto& [id, in_flight] : in_flight_) {
    TransferCompletion lost;
    lost.id = id;
    lost.type = in_flight.type;
    lost.endpoint = in_flight.type == TransferType::kControl ? 0 : in_flight.endpoint;
    lost.status = TransferStatus::kDisconnected;
    out.push_back(std::move(lost));
  }
  in_flight_.clear();
}

size_t FaultyTransport::Drain(std::vector<TransferCompletion>& out) {
  const size_t before = out.size();
  drained_.clear();
  inner_->Drain(drained_);
  for (TransferCompletion& completion : drained_) Take(std::move(completion), out);
  const sync::TimeNs now = clock_.Now();
  sync::TimeNs next = sync::kNever;
  for (auto& [endpoint, queue] : held_) {
    while (!queue.empty() && queue.front().due <= now) {
      in_flight_.erase(queue.front().completion.id);
      out.push_back(std::move(queue.front().completion));
      queue.pop_front();
    }
    if (!queue.empty()) next = std::min(next, queue.front().due);
  }
  sync::MutexLock lock(mutex_);
  if (next != next_due_) {
    next_due_ = next;
    poked_ = true;
    work_.NotifyAll();
  }
  return out.size() - before;
}

void FaultyTransport::SetWake(std::function<void()> wake) {
  {
    sync::MutexLock lock(wake_mutex_);
    wake_ = wake;
  }
  inner_->SetWake(std::move(wake));
}

sync::TimeNs FaultyTransport::Pump() {
  {
    sync::MutexLock lock(mutex_);
    if (next_due_ > clock_.Now()) return next_due_;
    next_due_ = sync::kNever;  // until Drain has checked
  }
  sync::MutexLock lock(wake_mutex_);
  if (wake_) wake_();
  return sync::kNever;
}

void FaultyTransport::Run() {
  while (true) {
    const sync::TimeNs next = Pump();
    sync::MutexLock lock(mutex_);
    while (!stop_ && !poked_ && clock_.Now() < next) clock_.WaitUntil(mutex_, work_, next);
    if (stop_) return;
    poked_ = false;
  }
}

}  // namespace voxeld::display
