#include "display/drivers/voxlink/voxlink_link.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::display::voxlink {
namespace {

constexpr int kEventReads = 8;  // interrupt transfers pending at any time
constexpr int kMostEventFailures = 16;
constexpr uint16_t kMostConfiguration = 1024;
constexpr sync::TimeNs kTryAgain = 10 * sync::kMillisecond;  // after there was no room
constexpr size_t kKeptFree = 8192;  // of the transport's limit, reserved for requests and events

}  // namespace

VoxlinkLink::VoxlinkLink(std::unique_ptr<UsbTransport> transport, sync::Clock& clock,
                         Client* client, Options options)
    : transport_(std::move(transport)), clock_(clock), client_(client), options_(options) {}

absl::Status VoxlinkLink::Open() {
  absl::Status status = transport_->Open();
  if (status.ok()) ++generation_;
  return status;
}

void VoxlinkLink::Close() {
  held_.reset();
  transport_->Close();
  ++generation_;
  failed_ = false;
  failure_.clear();
  controls_.clear();
  control_id_ = 0;
  session_ = false;
  event_reads_ = 0;
  events_held_ = false;
  refused_since_ = 0;
  event_failures_ = 0;
  status_asked_ = false;
  bulk_.clear();
  bulk_bytes_ = 0;
  recovery_ = Recovery::kNone;
  halted_ = false;
  recoveries_ = 0;
}

void VoxlinkLink::Fail(const std::string& reason) {
  if (failed_) return;
  failed_ = true;
  failure_ = reason;
}

// Poll tries again, for as long as it would wait for an answer.
void VoxlinkLink::NoRoom(const absl::Status& status) {
  const sync::TimeNs now = clock_.Now();
  if (refused_since_ == 0) refused_since_ = now;
  if (now - refused_since_ >= options_.control_timeout) Fail(std::string(status.message()));
}

sync::TimeNs VoxlinkLink::NextTry() const {
  return refused_since_ != 0 || held_.has_value() ? clock_.Now() + kTryAgain : sync::kNever;
}

// ---- control

void VoxlinkLink::Enqueue(ControlRequest request) {
  controls_.push_back(std::move(request));
  SendControl();
}

void VoxlinkLink::SendControl() {
  if (control_id_ != 0 || controls_.empty() || failed_) return;
  ControlRequest& request = controls_.front();
  absl::StatusOr<TransferId> id;
  if (request.kind == Kind::kClearHalt) {
    id = transport_->ClearHalt(request.endpoint);
  } else if (request.kind == Kind::kReset) {
    id = transport_->Reset();
  } else {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = request.setup;
    transfer.data = std::move(request.data);
    if ((request.setup.request_type & 0x80) != 0) transfer.length = request.setup.length;
    transfer.timeout = options_.control_timeout;
    id = transport_->Submit(std::move(transfer));
    // A refused transfer was not moved from.
    if (!id.ok()) request.data = std::move(transfer.data);  // NOLINT(bugprone-use-after-move)
  }
  if (absl::IsResourceExhausted(id.status())) return NoRoom(id.status());
  refused_since_ = 0;
  if (!id.ok()) return Fail(std::string(id.status().message()));
  control_id_ = *id;
}

void VoxlinkLink::ResetDevice() {
  ControlRequest request;
  request.kind = Kind::kReset;
  Enqueue(std::move(request));
}

void VoxlinkLink::ReadConfiguration() {
  ControlRequest request;
  request.kind = Kind::kConfiguration;
  request.setup = {.request_type = 0x80,
                   .request = 0x06,
                   .value = 0x0200,
                   .index = 0,
                   .length = kMostConfiguration};
  Enqueue(std::move(request));
}

void VoxlinkLink::Read(Request request, uint16_t value, uint16_t length) {
  ControlRequest control;
  control.setup = {.request_type = kRequestIn,
                   .request = static_cast<uint8_t>(request),
                   .value = value,
                   .index = 0,
                   .length = length};
  Enqueue(std::move(control));
}

void VoxlinkLink::Write(Request request, uint16_t value, std::span<const std::byte> data) {
  ControlRequest control;
  control.setup = {.request_type = kRequestOut,
                   .request = static_cast<uint8_t>(request),
                   .value = value,
                   .index = 0,
                   .length = static_cast<uint16_t>(data.size())};
  control.data.Append(data);
  Enqueue(std::move(control));
}

void VoxlinkLink::AskStatus() {
  if (status_asked_) return;
  status_asked_ = true;
  EnqueueStatus(Kind::kStatus);
}

void VoxlinkLink::EnqueueStatus(Kind kind) {
  ControlRequest control;
  control.kind = kind;
  control.setup = {.request_type = kRequestIn,
                   .request = static_cast<uint8_t>(Request::kGetStatus),
                   .value = 0,
                   .index = 0,
                   .length = sizeof(Status)};
  Enqueue(std::move(control));
}

void VoxlinkLink::OnControlDone(TransferCompletion& completion) {
  const ControlRequest request = std::move(controls_.front());
  controls_.pop_front();
  control_id_ = 0;
  const bool ok = completion.status == TransferStatus::kOk ||
                  (completion.status == TransferStatus::kShort && !completion.data.empty());
  if (!ok) {
    ++failures_;
    return Fail(absl::StrCat("request ", static_cast<int>(request.setup.request), " (value ",
                             request.setup.value, "): ", TransferStatusName(completion.status)));
  }
  SendControl();
  switch (request.kind) {
    case Kind::kConfiguration:
      return client_->OnConfiguration(completion.data);
    case Kind::kRequest:
      return client_->OnReply(static_cast<Request>(request.setup.request), completion.data);
    case Kind::kStatus:
    case Kind::kRecoveryStatus:
      return OnStatusReply(request.kind, completion.data);
    case Kind::kClearHalt:
    case Kind::kReset:
      return;
  }
}

// ---- events

void VoxlinkLink::BeginSession(uint32_t receive_buffer) {
  session_ = true;
  receive_buffer_ = receive_buffer;
  next_event_ = 0;
  sent_ = 0;
  credit_limit_ = 0;  // READY brings the first credit
  last_sent_ = last_progress_ = clock_.Now();
  PostEventReads();
}

void VoxlinkLink::PostEventReads() {
  while (event_reads_ < kEventReads && session_ && !failed_) {
    Transfer transfer;
    transfer.type = TransferType::kInterrupt;
    transfer.endpoint = kInterruptIn;
    transfer.length = kEventSize;
    const absl::StatusOr<TransferId> id = transport_->Submit(std::move(transfer));
    events_held_ = absl::IsResourceExhausted(id.status());
    if (events_held_) return NoRoom(id.status());
    refused_since_ = 0;
    if (!id.ok()) return Fail(std::string(id.status().message()));
    ++event_reads_;
  }
}

void VoxlinkLink::OnEventDone(TransferCompletion& completion) {
  --event_reads_;
  switch (completion.status) {
    case TransferStatus::kOk:
    case TransferStatus::kShort:
      break;
    case TransferStatus::kDisconnected:
      return Fail("the device was unplugged");
    case TransferStatus::kCancelled:
      return;
    default:
      ++failures_;
      if (++event_failures_ > kMostEventFailures) {
        return Fail(
            absl::StrCat("the event endpoint fails: ", TransferStatusName(completion.status)));
      }
      if (completion.status == TransferStatus::kStall) {
        ControlRequest clear;
        clear.kind = Kind::kClearHalt;
        clear.endpoint = kInterruptIn;
        Enqueue(std::move(clear));
      }
      AskStatus();  // an event may be lost; the next read is posted when the answer has come
      return;
  }
  event_failures_ = 0;
  const std::span<const std::byte> bytes(completion.data);
  const EventHeader header =
      bytes.size() >= sizeof(EventHeader) ? Load<EventHeader>(bytes) : EventHeader{};
  if (bytes.size() < sizeof(EventHeader) || header.length != bytes.size()) {
    return Fail(
        absl::StrCat("an event of ", bytes.size(), " bytes says that it has ", header.length));
  }
  if (header.sequence != next_event_) AskStatus();
  next_event_ = header.sequence + 1;
  if (header.credit_limit > credit_limit_) {
    credit_limit_ = header.credit_limit;
    last_progress_ = clock_.Now();
  }
  PostEventReads();
  client_->OnEvent(header, bytes.subspan(sizeof(EventHeader)));
}

void VoxlinkLink::OnStatusReply(Kind kind, std::span<const std::byte> data) {
  if (kind == Kind::kStatus) status_asked_ = false;
  if (data.size() < sizeof(Status)) {
    return Fail(absl::StrCat("a status of ", data.size(), " bytes; it has ", sizeof(Status)));
  }
  const auto status = Load<Status>(data);
  if (status.running == 0 && session_) return Fail("the device has left the session");
  PostEventReads();
  if (status.credit_limit > credit_limit_) {
    credit_limit_ = status.credit_limit;
    last_progress_ = clock_.Now();
  }
  // Valid because it was requested when nothing was in flight, and nothing was sent since.
  if (kind == Kind::kRecoveryStatus) {
    sent_ = status.bytes_received;
    recovery_ = Recovery::kNone;
  }
  const bool settled = bulk_.empty() && recovery_ == Recovery::kNone &&
                       status.bytes_received == sent_ &&
                       status.credit_limit == sent_ + receive_buffer_;
  client_->OnStatus(status, settled);
}

// ---- bulk

size_t VoxlinkLink::bulk_limit() const {
  const size_t all = transport_->max_bytes_in_flight();
  return std::min(options_.max_bytes_in_flight, all > kKeptFree ? all - kKeptFree : 0);
}

size_t VoxlinkLink::Room() const {
  if (!session_ || failed_ || recovering() || held_.has_value()) return 0;
  const size_t limit = bulk_limit();
  const uint64_t credit = credit_limit_ > sent_ ? credit_limit_ - sent_ : 0;
  return std::min<uint64_t>(credit, limit > bulk_bytes_ ? limit - bulk_bytes_ : 0);
}

TransferBytes VoxlinkLink::TakeBuffer() { return transport_->TakeBuffer(kTransferBytes); }

void VoxlinkLink::Send(TransferBytes buffer) {
  sent_ += buffer.size();
  last_sent_ = clock_.Now();
  SubmitBulk(std::move(buffer));
}

void VoxlinkLink::SubmitBulk(TransferBytes buffer) {
  const size_t size = buffer.size();
  Transfer transfer;
  transfer.type = TransferType::kBulk;
  transfer.endpoint = kBulkOut;
  transfer.data = std::move(buffer);
  transfer.timeout = options_.bulk_timeout;
  const absl::StatusOr<TransferId> id = transport_->Submit(std::move(transfer));
  if (absl::IsResourceExhausted(id.status())) {
    // A refused transfer was not moved from.
    held_ = std::move(transfer.data);  // NOLINT(bugprone-use-after-move)
    return;
  }
  if (!id.ok()) return Fail(std::string(id.status().message()));
  bulk_.emplace(*id, size);
  bulk_bytes_ += size;
}

void VoxlinkLink::NoteProgress() {
  recoveries_ = 0;
  last_progress_ = clock_.Now();
}

void VoxlinkLink::OnBulkDone(TransferCompletion& completion) {
  const auto it = bulk_.find(completion.id);
  bulk_bytes_ -= it->second;
  bulk_.erase(it);
  completion.data = {};
  switch (completion.status) {
    case TransferStatus::kOk:
      break;
    case TransferStatus::kDisconnected:
      return Fail("the device was unplugged");
    case TransferStatus::kStall:
      halted_ = true;
      [[fallthrough]];
    default:
      ++failures_;
      Recover();
      break;
  }
  StepRecovery();
}

void VoxlinkLink::Recover() {
  if (recovering()) return;
  if (++recoveries_ > options_.max_recoveries) {
    return Fail(absl::StrCat("transfers failed ", options_.max_recoveries, " times in a row"));
  }
  recovery_ = Recovery::kDraining;
  StepRecovery();
}

void VoxlinkLink::StepRecovery() {
  if (recovery_ != Recovery::kDraining || !bulk_.empty()) return;
  held_.reset();  // lost with the bytes before it
  if (std::exchange(halted_, false)) {
    ControlRequest clear;
    clear.kind = Kind::kClearHalt;
    clear.endpoint = kBulkOut;
    Enqueue(std::move(clear));
  }
  recovery_ = Recovery::kAsking;
  EnqueueStatus(Kind::kRecoveryStatus);
}

void VoxlinkLink::Poll() {
  drained_.clear();
  transport_->Drain(drained_);
  std::vector<TransferCompletion> completions = std::move(drained_);
  const uint64_t generation = generation_;
  for (TransferCompletion& completion : completions) {
    if (generation != generation_) break;  // closed by a client's function
    if (completion.id == control_id_) {
      OnControlDone(completion);
    } else if (bulk_.contains(completion.id)) {
      OnBulkDone(completion);
    } else if (completion.type == TransferType::kInterrupt) {
      OnEventDone(completion);
    }
  }
  completions.clear();
  drained_ = std::move(completions);
  // Retry what there was no room for.
  if (generation == generation_) {
    SendControl();
    if (events_held_) PostEventReads();
  }
  if (held_.has_value() && generation == generation_ && !recovering()) {
    TransferBytes held = *std::exchange(held_, std::nullopt);
    SubmitBulk(std::move(held));
  }
  if (failed_ && generation == generation_) {
    const std::string reason = std::move(failure_);
    client_->OnLinkFailed(reason);
  }
}

}  // namespace voxeld::display::voxlink
