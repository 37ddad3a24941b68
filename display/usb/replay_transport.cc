#include "display/usb/replay_transport.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/usb/usbmon.h"

namespace voxeld::display {
namespace {

size_t BytesOf(const Transfer& transfer) {
  return std::max<size_t>(transfer.data.size(), transfer.length);
}

uint8_t EndpointOf(const Transfer& transfer) {
  return transfer.type == TransferType::kControl ? 0 : transfer.endpoint;
}

Transfer ControlOf(const UsbSetup& setup) {
  Transfer transfer;
  transfer.type = TransferType::kControl;
  transfer.setup = setup;
  return transfer;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ReplayTransport>> ReplayTransport::Make(
    std::vector<std::byte> recording, sync::Clock& clock, Options options) {
  // Moving a vector does not move its bytes.
  absl::StatusOr<std::vector<RecordedSession>> sessions = ReadSessions(recording);
  if (!sessions.ok()) return sessions.status();
  return std::unique_ptr<ReplayTransport>(
      new ReplayTransport(std::move(recording), *std::move(sessions), clock, std::move(options)));
}

absl::StatusOr<std::unique_ptr<ReplayTransport>> ReplayTransport::FromFile(const std::string& path,
                                                                           sync::Clock& clock,
                                                                           Options options,
                                                                           uint64_t max_bytes) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) {
    return absl::ErrnoToStatus(errno, absl::StrCat("opening the recording \"", path, "\""));
  }
  const auto size = static_cast<uint64_t>(std::max<std::streamoff>(file.tellg(), 0));
  if (size > max_bytes) {
    return absl::ResourceExhaustedError(absl::StrCat("the recording \"", path, "\" has ", size,
                                                     " bytes; at most ", max_bytes,
                                                     " can be replayed"));
  }
  std::vector<std::byte> recording(size);
  file.seekg(0);
  file.read(reinterpret_cast<char*>(recording.data()), static_cast<std::streamsize>(size));
  if (!file) {
    return absl::DataLossError(absl::StrCat("the recording \"", path, "\" could not be read"));
  }
  absl::StatusOr<std::unique_ptr<ReplayTransport>> made =
      Make(std::move(recording), clock, std::move(options));
  if (made.ok()) return made;
  return absl::Status(made.status().code(),
                      absl::StrCat("\"", path, "\": ", std::string(made.status().message())));
}

ReplayTransport::ReplayTransport(std::vector<std::byte> recording,
                                 std::vector<RecordedSession> sessions, sync::Clock& clock,
                                 Options options)
    : recording_(std::move(recording)),
      sessions_(std::move(sessions)),
      clock_(clock),
      options_(std::move(options)) {
  if (options_.own_thread) thread_ = std::thread([this] { Run(); });
}

ReplayTransport::~ReplayTransport() {
  if (!thread_.joinable()) return;
  {
    sync::MutexLock lock(mutex_);
    stop_ = true;
    work_.NotifyAll();
  }
  thread_.join();
}

absl::Status ReplayTransport::status() const {
  sync::MutexLock lock(mutex_);
  return status_;
}

bool ReplayTransport::finished() const {
  sync::MutexLock lock(mutex_);
  const bool last_ended =
      session_ == sessions_.size() || (session_ + 1 == sessions_.size() && open_ && gone_);
  return status_.ok() && !skipped_ && last_ended;
}

absl::Status ReplayTransport::Open() {
  sync::MutexLock lock(mutex_);
  if (open_) return absl::FailedPreconditionError("the recording is open already");
  if (!status_.ok()) return status_;
  if (session_ == sessions_.size()) return absl::NotFoundError("the recording is at its end");
  if (clock_.Now() < there_from_) {
    return absl::NotFoundError("the device was not there yet when it was recorded");
  }
  open_ = true;
  gone_ = arrived_ = told_ = false;
  step_ = 0;
  played_.assign(session().transfers.size(), Played{});
  next_.clear();
  return absl::OkStatus();
}

void ReplayTransport::Close() {
  sync::MutexLock lock(mutex_);
  if (!open_) return;
  open_ = false;
  pending_.clear();
  completions_.clear();
  bytes_in_flight_ = 0;
  skipped_ |= std::any_of(played_.begin(), played_.end(),
                          [](const Played& played) { return !played.submitted; });
  const sync::TimeNs ended = session().last_ns;
  there_from_ = ++session_ == sessions_.size() ? sync::kNever : clock_.Now();
  if (!options_.at_once && session_ < sessions_.size()) {
    there_from_ += std::max<sync::TimeNs>(session().first_ns - ended, 0);
  }
  poked_ = true;
  work_.NotifyAll();
}

bool ReplayTransport::is_open() const {
  sync::MutexLock lock(mutex_);
  return open_;
}

absl::Status ReplayTransport::Compare(const RecordedTransfer& recorded,
                                      const Transfer& transfer) const {
  const std::string where = absl::StrCat("packet ", recorded.packet, " of the recording, ",
                                         TransferName(recorded.type, recorded.endpoint), ": ");
  const auto differ = [&](const char* what, size_t at, uint8_t actual, uint8_t expected) {
    return absl::InvalidArgumentError(absl::StrFormat("%s%s %d is 0x%02x; recorded is 0x%02x",
                                                      where, what, at, actual, expected));
  };
  if (transfer.type != recorded.type) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, "the transfer is ", TransferName(transfer.type, transfer.endpoint)));
  }
  if (transfer.type == TransferType::kControl) {
    const std::array<uint8_t, 8> actual = SetupBytes(transfer.setup);
    const std::array<uint8_t, 8> expected = SetupBytes(recorded.setup);
    for (size_t i = 0; i < actual.size(); ++i) {
      if (actual[i] != expected[i]) return differ("setup byte", i, actual[i], expected[i]);
    }
  }
  const auto [actual, expected] = std::mismatch(transfer.data.begin(), transfer.data.end(),
                                                recorded.out.begin(), recorded.out.end());
  if (actual != transfer.data.end() && expected != recorded.out.end()) {
    return differ("byte", static_cast<size_t>(actual - transfer.data.begin()),
                  std::to_integer<uint8_t>(*actual), std::to_integer<uint8_t>(*expected));
  }
  if (transfer.data.size() != recorded.out_length) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, "it has ", transfer.data.size(), " bytes; recorded are ", recorded.out_length,
        "; they agree up to byte ", std::min<size_t>(transfer.data.size(), recorded.out.size())));
  }
  if (transfer.length != recorded.in_length) {
    return absl::InvalidArgumentError(absl::StrCat(where, "it asks for ", transfer.length,
                                                   " bytes; recorded are ", recorded.in_length));
  }
  return absl::OkStatus();
}

absl::Status ReplayTransport::Unrecorded(const Transfer& transfer) {
  if (transfer.length == 0) {
    return absl::UnavailableError(absl::StrCat(
        "the recording's session ", session_ + 1, " of ", sessions_.size(), " has no more ",
        TransferName(transfer.type, transfer.endpoint), " transfers"));
  }
  if (BytesOf(transfer) > options_.max_bytes_in_flight - bytes_in_flight_) {
    return absl::ResourceExhaustedError(absl::StrCat(BytesOf(transfer), " bytes more than the ",
                                                     bytes_in_flight_, " in flight; at most ",
                                                     options_.max_bytes_in_flight, " may be"));
  }
  return absl::OkStatus();
}

absl::StatusOr<TransferId> ReplayTransport::Submit(Transfer&& transfer) {
  sync::MutexLock lock(mutex_);
  if (!open_) return absl::FailedPreconditionError("the recording is not open");
  if (gone_) return absl::UnavailableError("the device was unplugged");
  const auto recorded_here = session().by_endpoint.find(EndpointOf(transfer));
  size_t& next = next_[EndpointOf(transfer)];
  const sync::TimeNs now = clock_.Now();
  Pending pending;
  if (recorded_here == session().by_endpoint.end() || next == recorded_here->second.size()) {
    const absl::Status status = Unrecorded(transfer);
    if (!status.ok()) return status;
  } else {
    pending.recorded = recorded_here->second[next];
    const RecordedTransfer& recorded = session().transfers[pending.recorded];
    const absl::Status status = Compare(recorded, transfer);
    poked_ = true;
    work_.NotifyAll();
    if (!status.ok()) {
      status_ = status;
      Unplug();
      return status;
    }
    ++next;
    played_[pending.recorded] = {
        .submitted = true, .ended = recorded.refused, .id = next_id_, .submitted_at = now};
    if (recorded.refused) return recorded.refusal;
  }
  pending.size = BytesOf(transfer);
  if (transfer.timeout > 0) pending.deadline = now + transfer.timeout;
  pending.transfer = std::move(transfer);
  bytes_in_flight_ += pending.size;
  pending_.emplace(next_id_, std::move(pending));
  return next_id_++;
}

absl::StatusOr<TransferId> ReplayTransport::ClearHalt(uint8_t endpoint) {
  return Submit(ControlOf(ClearHaltSetup(endpoint)));
}

absl::StatusOr<TransferId> ReplayTransport::Reset() { return Submit(ControlOf(kPortResetSetup)); }

void ReplayTransport::Complete(TransferId id, TransferStatus status, uint32_t actual,
                               std::span<const std::byte> in) {
  const auto it = pending_.find(id);
  if (it == pending_.end()) return;
  Pending pending = std::move(it->second);
  pending_.erase(it);
  bytes_in_flight_ -= pending.size;
  if (pending.recorded != Pending::kNotRecorded) played_[pending.recorded].ended = true;
  TransferCompletion completion;
  completion.id = id;
  completion.type = pending.transfer.type;
  completion.endpoint = pending.transfer.endpoint;
  completion.status = status;
  completion.actual_length = actual;
  completion.data = std::move(pending.transfer.data);
  if (pending.transfer.length > 0) completion.data = TransferBytes(in);
  completions_.push_back(std::move(completion));
}

void ReplayTransport::Unplug() {
  gone_ = true;
  while (!pending_.empty()) {
    Complete(pending_.begin()->first, TransferStatus::kDisconnected, 0, {});
  }
}

void ReplayTransport::Cancel(TransferId id) {
  sync::MutexLock lock(mutex_);
  Complete(id, TransferStatus::kCancelled, 0, {});
  poked_ = true;
  work_.NotifyAll();
}

sync::TimeNs ReplayTransport::Play(sync::TimeNs now) {
  for (; step_ < session().steps.size(); ++step_) {
    const RecordedStep& step = session().steps[step_];
    const Played& played = played_[step.transfer];
    if (!played.submitted) return sync::kNever;  // wait until it is
    if (!step.completes || played.ended) continue;
    const RecordedTransfer& recorded = session().transfers[step.transfer];
    const sync::TimeNs due = played.submitted_at + (recorded.completed_ns - recorded.submitted_ns);
    if (!options_.at_once && due > now) return due;
    Complete(played.id, recorded.status, recorded.actual_length, recorded.in);
  }
  Unplug();
  return sync::kNever;
}

void ReplayTransport::ExpireTimeouts(sync::TimeNs now) {
  std::vector<TransferId> late;
  for (const auto& [id, pending] : pending_) {
    if (pending.deadline <= now) late.push_back(id);
  }
  for (const TransferId id : late) Complete(id, TransferStatus::kTimedOut, 0, {});
}

sync::TimeNs ReplayTransport::Pump() {
  sync::TimeNs next = sync::kNever;
  bool wake = false;
  {
    sync::MutexLock lock(mutex_);
    const sync::TimeNs now = clock_.Now();
    if (open_ && !gone_) {
      next = Play(now);
      ExpireTimeouts(now);
      for (const auto& [id, pending] : pending_) next = std::min(next, pending.deadline);
    } else if (!open_ && status_.ok() && session_ > 0 && there_from_ != sync::kNever) {
      // The first session's device was present from the beginning; this one arrives later.
      if (now < there_from_) {
        next = there_from_;
      } else if (!told_) {
        told_ = arrived_ = wake = true;
      }
    }
    wake |= !completions_.empty();
  }
  if (wake) {
    sync::MutexLock lock(wake_mutex_);
    if (wake_) wake_();
  }
  return next;
}

TransferBytes ReplayTransport::TakeBuffer(size_t capacity) {
  TransferBytes buffer;
  buffer.reserve(capacity);
  return buffer;
}

size_t ReplayTransport::Drain(std::vector<TransferCompletion>& out) {
  sync::MutexLock lock(mutex_);
  const size_t count = completions_.size();
  std::move(completions_.begin(), completions_.end(), std::back_inserter(out));
  completions_.clear();
  return count;
}

size_t ReplayTransport::bytes_in_flight() const {
  sync::MutexLock lock(mutex_);
  return bytes_in_flight_;
}

void ReplayTransport::SetWake(std::function<void()> wake) {
  sync::MutexLock lock(wake_mutex_);
  wake_ = std::move(wake);
}

bool ReplayTransport::TakeArrival() {
  sync::MutexLock lock(mutex_);
  return std::exchange(arrived_, false);
}

void ReplayTransport::Run() {
  while (true) {
    const sync::TimeNs next = Pump();
    sync::MutexLock lock(mutex_);
    while (!stop_ && !poked_ && clock_.Now() < next) clock_.WaitUntil(mutex_, work_, next);
    if (stop_) return;
    poked_ = false;
  }
}

}  // namespace voxeld::display
