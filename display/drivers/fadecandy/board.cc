#include "display/drivers/fadecandy/board.h"

#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "display/drivers/fadecandy/packets.h"

namespace voxeld::display::fadecandy {
namespace {

// A board accepts a frame at each refresh, some milliseconds apart.
constexpr sync::TimeNs kTimeout = sync::kSecond;
// After this much silence the board is asked for a counter: an idle board's loss goes unnoticed
// otherwise.
constexpr sync::TimeNs kAskAfter = 60 * sync::kMillisecond;
constexpr sync::TimeNs kRoomAfter = 10 * sync::kMillisecond;
constexpr int kMostFailures = 5;
constexpr size_t kFrameOnWire = kFramePackets * kPacketBytes;
constexpr uint16_t kCounterBytes = 4;
constexpr char kUnplugged[] = "it was unplugged";

}  // namespace

Board::Board(std::unique_ptr<UsbTransport> transport, std::string serial, sync::Clock& clock,
             OnBytes on_bytes)
    : transport_(std::move(transport)),
      serial_(std::move(serial)),
      clock_(clock),
      on_bytes_(std::move(on_bytes)) {}

std::string Board::Name() const {
  const std::string serial = Serial();
  if (serial.empty()) return absl::StrCat("board ", slice_ + 1);
  return absl::StrCat("board ", slice_ + 1, " (serial ", absl::CHexEscape(serial), ")");
}

absl::Status Board::Open() {
  absl::Status status = transport_->Open();
  if (status.ok()) ask_at_ = clock_.Now() + kAskAfter;
  return status;
}

void Board::Close() {
  transport_->Close();
  failure_.clear();
  due_ = in_flight_ = SetUp{};
  video_ = Video::kNone;
  video_in_flight_ = false;
  rgb_ = {};
  shown_ns_ = 0;
  bulk_ = request_id_ = 0;
  buffer_ = {};  // its memory may be the device's
  request_ = Request::kNone;
  halted_ = false;
  failures_ = 0;
  set_up_last_ = false;
}

void Board::Configure(uint8_t flags) {
  flags_ = flags;
  due_.config = true;
}

void Board::SetLut(std::shared_ptr<const Lut> lut) {
  lut_ = std::move(lut);
  due_.lut = true;
}

void Board::Blacken() { due_.black = true; }

void Board::Load(std::span<const std::byte> rgb, bool twice) {
  rgb_ = rgb;
  twice_ = twice;
  video_ = Video::kLoad;
}

void Board::Show() { video_ = Video::kShow; }

void Board::Refused(const absl::Status& status) {
  if (absl::IsResourceExhausted(status)) return;  // a wake reports new room
  Fail(absl::IsUnavailable(status) ? kUnplugged : std::string(status.message()));
}

void Board::Fail(std::string reason) {
  if (failure_.empty()) failure_ = std::move(reason);
}

// ---- sending

sync::TimeNs Board::Pump() {
  if (!failure_.empty() || !transport_->is_open()) return sync::kNever;
  const sync::TimeNs now = clock_.Now();
  if (request_ == Request::kNone) SubmitRequest(now);
  const bool recovering = reset_due_ || halted_ || request_ == Request::kReset;
  if (bulk_ == 0 && !recovering && failure_.empty()) {
    if (buffer_.empty()) Compose();
    if (!buffer_.empty()) SubmitBulk();
    if (!buffer_.empty()) return now + kRoomAfter;
  }
  return request_ == Request::kNone ? ask_at_ : sync::kNever;
}

void Board::Compose() {
  const bool video_due = video_ == Video::kLoad || video_ == Video::kShow;
  if (!video_due && !due_.any()) return;
  // Take turns: moving a brightness slider must not delay frames.
  const bool video = video_due && (!due_.any() || set_up_last_);
  set_up_last_ = !video;
  if (buffer_.capacity() == 0) buffer_ = transport_->TakeBuffer(4 * kFrameOnWire);
  if (video) {
    video_in_flight_ = true;
    if (video_ == Video::kLoad) {
      if (twice_) AppendFrame(buffer_, rgb_, 0, kFramePackets);
      AppendFrame(buffer_, rgb_, 0, kLastPacket);
    } else {
      AppendFrame(buffer_, rgb_, kLastPacket, kFramePackets);
    }
  } else {
    in_flight_ = std::exchange(due_, SetUp{});
    if (in_flight_.config) AppendConfig(buffer_, flags_);
    if (in_flight_.black) {
      const std::vector<std::byte> black(kFrameBytes);
      AppendFrame(buffer_, black, 0, kFramePackets);
      AppendFrame(buffer_, black, 0, kFramePackets);
    }
    if (in_flight_.lut) AppendLut(buffer_, *lut_);
  }
  on_bytes_(*this, buffer_, video);
}

void Board::SubmitBulk() {
  Transfer transfer;
  transfer.type = TransferType::kBulk;
  transfer.endpoint = kBulkOut;
  transfer.data = std::move(buffer_);
  transfer.timeout = kTimeout;
  const absl::StatusOr<TransferId> id = transport_->Submit(std::move(transfer));
  if (id.ok()) {
    bulk_ = *id;
    return;
  }
  // A refused transfer was not moved from.
  buffer_ = std::move(transfer.data);  // NOLINT(bugprone-use-after-move)
  Refused(id.status());
}

void Board::SubmitRequest(sync::TimeNs now) {
  absl::StatusOr<TransferId> id;
  if (reset_due_) {
    request_ = Request::kReset;
    id = transport_->Reset();
  } else if (halted_ && bulk_ == 0) {
    request_ = Request::kClearHalt;
    id = transport_->ClearHalt(kBulkOut);
  } else if (now >= ask_at_) {
    request_ = Request::kCounter;
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = {.request_type = kRequestIn,
                      .request = kGetCounter,
                      .value = 0,
                      .index = kRefreshCounter,
                      .length = kCounterBytes};
    transfer.length = kCounterBytes;
    transfer.timeout = kTimeout;
    id = transport_->Submit(std::move(transfer));
  } else {
    return;
  }
  if (id.ok()) {
    request_id_ = *id;
    return;
  }
  request_ = Request::kNone;
  ask_at_ = now + kRoomAfter;
  Refused(id.status());
}

void Board::Darken() {
  Transfer transfer;
  transfer.type = TransferType::kBulk;
  transfer.endpoint = kBulkOut;
  AppendLut(transfer.data, Lut{});
  transfer.timeout = kTimeout;
  transport_->Submit(std::move(transfer)).IgnoreError();
}

// ---- completions

void Board::Poll() {
  drained_.clear();
  transport_->Drain(drained_);
  for (TransferCompletion& completion : drained_) {
    if (completion.id == bulk_) {
      OnBulkDone(completion);
    } else if (completion.id == request_id_) {
      OnRequestDone(completion);
    }
  }
}

void Board::OnBulkDone(TransferCompletion& completion) {
  bulk_ = 0;
  const size_t size = completion.data.size();
  buffer_ = std::move(completion.data);
  buffer_.clear();
  switch (completion.status) {
    case TransferStatus::kOk:
      if (completion.actual_length == size) return Delivered();
      break;
    case TransferStatus::kDisconnected:
      return Fail(kUnplugged);
    case TransferStatus::kTimedOut:
      reset_due_ = true;
      ++failed_transfers_;
      return Fail(absl::StrCat("it took no bytes for ", kTimeout / sync::kMillisecond, " ms"));
    case TransferStatus::kStall:
      halted_ = true;
      break;
    default:
      break;
  }
  Again(completion.status);
}

void Board::Delivered() {
  ask_at_ = clock_.Now() + kAskAfter;
  if (!std::exchange(video_in_flight_, false)) {
    in_flight_ = SetUp{};
    failures_ = 0;
  } else if (video_ == Video::kLoad) {
    video_ = Video::kLoaded;
  } else {
    video_ = Video::kShown;
    shown_ns_ = clock_.Now();
    failures_ = 0;
  }
}

void Board::CountFailure(TransferStatus status) {
  ++failed_transfers_;
  if (++failures_ <= kMostFailures) return;
  Fail(absl::StrCat("transfers failed ", failures_,
                    " times in a row, the last one: ", TransferStatusName(status)));
}

void Board::Again(TransferStatus status) {
  CountFailure(status);
  if (std::exchange(video_in_flight_, false)) {
    video_ = Video::kLoad;
    ++reloads_;
  }
  const SetUp lost = std::exchange(in_flight_, SetUp{});
  due_.config |= lost.config;
  due_.lut |= lost.lut;
  due_.black |= lost.black;
}

void Board::OnRequestDone(const TransferCompletion& completion) {
  request_id_ = 0;
  const Request request = std::exchange(request_, Request::kNone);
  ask_at_ = clock_.Now() + kAskAfter;
  switch (completion.status) {
    case TransferStatus::kOk:
    case TransferStatus::kShort:
      if (request == Request::kReset) reset_due_ = false;
      if (request == Request::kClearHalt) halted_ = false;
      return;
    case TransferStatus::kDisconnected:
      if (request == Request::kReset) reset_due_ = false;  // it came back as another device
      return Fail(kUnplugged);
    case TransferStatus::kTimedOut:
      reset_due_ = true;
      return Fail(
          absl::StrCat("it answered no request for ", kTimeout / sync::kMillisecond, " ms"));
    default:
      // A board that refuses to return its counter is still present.
      if (request == Request::kCounter && completion.status == TransferStatus::kStall) return;
      return CountFailure(completion.status);
  }
}

}  // namespace voxeld::display::fadecandy
