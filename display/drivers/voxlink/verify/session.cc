#include "display/drivers/voxlink/verify/session.h"

#include <algorithm>
#include <utility>

namespace voxeld::display::voxlink {

using sync::kMillisecond;
using sync::kSecond;

namespace {

constexpr size_t kReads = 16;  // interrupt transfers pending at any time
constexpr size_t kVerifyTransferBytes = size_t{64} << 10;
constexpr size_t kGatherBytes = size_t{256} << 10;
constexpr sync::TimeNs kVerifyKeepaliveAfter = 70 * kMillisecond;
// Without any progress by the device.
constexpr sync::TimeNs kStuck = 3 * kSecond;
constexpr sync::TimeNs kStatusInterval = 20 * kMillisecond;
constexpr sync::TimeNs kLongestPeriod = 5 * kSecond;
constexpr size_t kLargestVolume = size_t{256} << 20;
constexpr size_t kMostEvents = 200'000;  // in one case

}  // namespace

Session::Session(conformance::Probe& probe) : probe_(probe) {}

Session::~Session() { CancelReads(); }

// ---- sessions

void Session::Start() { Start(SmallestMode()); }

void Session::Start(const Mode& mode) {
  if (!ok()) return;
  const FrameLayout layout = LayoutOf(mode);
  if (!ok()) return;
  layout_ = layout;
  if (layout_.bytes() > kLargestVolume) {
    return check().NotApplicable(absl::StrCat("a volume has ", layout_.bytes(), " bytes; at most ",
                                              kLargestVolume, " are sent for a case"));
  }
  Do(Request::kSetMode, 0, BytesOf(mode));
  const uint32_t rate = GetMode().rate_mhz;
  if (!ok()) return;
  if (rate == 0) return check().Fail("GET_MODE gives the rate in use", "a rate of 0", "4.3");
  period_ = std::max<sync::TimeNs>(1000 * kSecond / static_cast<sync::TimeNs>(rate), 1);
  if (period_ > kLongestPeriod) {
    return check().NotApplicable(
        absl::StrCat("a sweep takes ", period_ / kMillisecond, " ms; at most 5000 are waited for"));
  }
  Restart();
}

void Session::Restart() {
  if (!ok()) return;
  CancelReads();
  BeginSession();
  Do(Request::kStart);
  if (!ok()) return;
  running_ = true;
  PostReads();
  if (!listening_) {
    credit_limit_ = GetStatus().credit_limit;
    return;
  }
  const auto any = [](const Event&) { return true; };
  const Event first = Await("an event, READY, after START", kEventLimit, any);
  if (ok() && first.type() != EventType::kReady) {
    check().Fail("the first event after START is READY", Describe(first), "4.5");
  }
}

void Session::BeginSession() {
  writer_.Restart();
  gathered_.clear();
  sent_ = credit_limit_ = told_ = 0;
  last_sent_ = probe_.Now();
  log_.clear();
  mark_ = 0;
}

// ---- packets

std::vector<std::byte> Session::PictureBytes(uint64_t volume, uint32_t picture) const {
  std::vector<std::byte> bytes(layout_.bytes_per_slice());
  auto value = static_cast<uint32_t>(volume * 2654435761u + picture * 40503u + 1);
  for (std::byte& byte : bytes) {
    value = value * 1664525u + 1013904223u;
    byte = static_cast<std::byte>(value >> 24);
  }
  return bytes;
}

void Session::Raw(std::span<const std::byte> bytes) {
  AppendBytes(gathered_, bytes);
  if (gathered_.size() >= kGatherBytes) Flush();
}

void Session::Begin(uint64_t volume, uint64_t base, std::span<const std::byte> bitmap) {
  writer_.Begin(gathered_, volume, base, pictures(), bitmap);
}

void Session::Fragment(uint64_t volume, uint32_t picture, uint32_t offset,
                       std::span<const std::byte> bytes) {
  const auto subs = static_cast<uint32_t>(std::max(layout_.sub_frames, 1));
  writer_.Slice(gathered_, volume, picture / subs, static_cast<uint16_t>(picture % subs), offset,
                bytes);
  if (gathered_.size() >= kGatherBytes) Flush();
}

void Session::Picture(uint64_t volume, uint32_t picture) {
  const std::vector<std::byte> bytes = PictureBytes(volume, picture);
  const size_t most = std::max<size_t>(capabilities().fixed.max_payload, 1);
  for (size_t at = 0; ok() && at < bytes.size(); at += most) {
    Fragment(volume, picture, static_cast<uint32_t>(at),
             std::span(bytes).subspan(at, std::min(most, bytes.size() - at)));
  }
}

void Session::End(uint64_t volume, bool show) { writer_.End(gathered_, volume, show); }

void Session::Plain(PacketType type, uint64_t volume) { writer_.Plain(gathered_, type, volume); }

void Session::Show(uint64_t volume, uint64_t sweep) { writer_.Show(gathered_, volume, sweep); }

void Session::ShowAhead(uint64_t volume, uint64_t sweep, uint32_t ahead) {
  writer_.ShowAhead(gathered_, volume, sweep, ahead);
}

void Session::Whole(uint64_t volume, bool show) {
  Begin(volume);
  for (uint32_t picture = 0; ok() && picture < pictures(); ++picture) Picture(volume, picture);
  End(volume, show);
  Flush();
}

void Session::Flush() {
  const std::vector<std::byte> bytes = std::exchange(gathered_, {});
  SendNow(bytes);
}

void Session::SendNow(std::span<const std::byte> bytes) {
  while (ok() && !bytes.empty()) {
    size_t size = std::min(bytes.size(), kVerifyTransferBytes);
    if (split_) size = std::min(split_(), size);
    if (size > 0) size = std::min(size, WaitForCredit());
    if (!ok()) return;
    SendTransfer(bytes.first(size));
    bytes = bytes.subspan(size);
  }
}

void Session::SendTransfer(std::span<const std::byte> bytes) {
  const conformance::Answer answer = probe_.Bulk(kBulkOut, bytes, zero_packets_);
  sent_ += bytes.size();
  last_sent_ = probe_.Now();
  if (answer.status != TransferStatus::kOk || answer.actual != bytes.size()) {
    check().Fail(absl::StrCat("endpoint 0x01 takes a transfer of ", bytes.size(), " bytes"),
                 answer.ok() ? absl::StrCat(answer.actual, " bytes were taken") : Describe(answer),
                 "5.1");
  }
  TakeEvents();
}

size_t Session::WaitForCredit() {
  const sync::TimeNs begin = probe_.Now();
  // discarded: credit does not apply outside a session
  if (!running_) return kVerifyTransferBytes;
  while (ok() && sent_ >= credit_limit_) {
    if (probe_.Now() - begin > kStuck) {
      check().Fail("credit for the bytes that were consumed",
                   absl::StrCat(sent_, " bytes were sent, which is the limit, and for 3 s none ",
                                "was told to be consumed"),
                   "7");
      return 0;
    }
    if (!listening_) GetStatus();  // it gives credit as events do
    Step(std::min(begin + kStuck, probe_.Now() + kStatusInterval) + kMillisecond);
  }
  return ok() ? static_cast<size_t>(credit_limit_ - sent_) : 0;
}

void Session::KeepAlive() {
  if (!running_ || !keepalive_ || !ok()) return;
  if (probe_.Now() - last_sent_ < kVerifyKeepaliveAfter) return;
  std::vector<std::byte> packet;
  if (credit_limit_ < sent_ + sizeof(PacketHeader)) return;
  writer_.Plain(packet, PacketType::kKeepalive, 0);
  SendTransfer(packet);
}

void Session::Settle() {
  Flush();
  uint64_t consumed = 0;
  sync::TimeNs progress = probe_.Now();
  const uint32_t buffer = capabilities().fixed.receive_buffer;
  while (ok() && running_) {
    const Status status = GetStatus();
    if (!ok()) return;
    const uint64_t now = status.credit_limit - std::min<uint64_t>(status.credit_limit, buffer);
    if (now >= sent_) return;
    if (now > consumed) progress = probe_.Now();
    consumed = now;
    if (probe_.Now() - progress > kStuck) {
      return check().Fail(
          absl::StrCat("all ", sent_, " bytes that were sent are consumed: credit_limit ",
                       sent_ + buffer),
          absl::StrCat("credit_limit ", status.credit_limit, ", for 3 s"), "7");
    }
    Pause(kStatusInterval);
  }
}

// ---- events

void Session::SetListening(bool on) {
  listening_ = on;
  if (on) {
    PostReads();
  } else {
    CancelReads();
  }
}

void Session::PostReads() {
  while (ok() && running_ && listening_ && reads_.size() < kReads) {
    Transfer transfer;
    transfer.type = TransferType::kInterrupt;
    transfer.endpoint = kInterruptIn;
    transfer.length = kEventSize;
    const std::optional<TransferId> id = probe_.Post(std::move(transfer));
    if (!id) return check().Fail("endpoint 0x82 can be read", "the device is gone", "6");
    reads_.push_back(*id);
  }
}

void Session::CancelReads() {
  probe_.Cancel(reads_);
  reads_.clear();
}

void Session::TakeEvents() {
  bool came = true;
  while (ok() && std::exchange(came, false)) {
    for (size_t i = 0; i < reads_.size(); ++i) {
      const std::optional<TransferCompletion> read = probe_.Take(reads_[i]);
      if (!read) continue;
      reads_.erase(reads_.begin() + static_cast<ptrdiff_t>(i));
      if (read->status == TransferStatus::kOk || read->status == TransferStatus::kShort) {
        TakeEvent(read->data);
      } else if (read->status != TransferStatus::kCancelled) {
        check().Fail("endpoint 0x82 gives events of at most 64 bytes",
                     absl::StrCat("a read ended as ", TransferStatusName(read->status)), "6");
      }
      PostReads();
      came = true;
      break;
    }
  }
}

void Session::TakeEvent(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof(EventHeader)) {
    return check().Fail("an event has 24 bytes or more", conformance::Hex(bytes), "6");
  }
  Event event;
  event.header = Load<EventHeader>(bytes);
  event.body.assign(bytes.begin() + sizeof(EventHeader), bytes.end());
  event.at = probe_.Now();
  const EventHeader& header = event.header;
  static constexpr size_t kBodies[] = {0,
                                       sizeof(ReadyEvent),
                                       0,
                                       sizeof(SweepEvent),
                                       sizeof(CompleteEvent),
                                       sizeof(MissingEvent),
                                       sizeof(VolumeEvent),
                                       sizeof(ShownEvent),
                                       sizeof(VolumeEvent),
                                       sizeof(UnderrunEvent),
                                       sizeof(HealthEvent),
                                       sizeof(ErrorEvent),
                                       sizeof(LightEvent)};
  const size_t body = header.type < std::size(kBodies) ? kBodies[header.type] : 0;
  if (header.length != bytes.size() || event.body.size() < body) {
    check().Fail(absl::StrCat("the length of event type ", int{header.type},
                              " is that of the whole event, ", sizeof(header) + body, " or more"),
                 absl::StrCat("length ", header.length, " in ", bytes.size(), " bytes"), "6");
  }
  if (!log_.empty()) {
    const EventHeader& before = log_.back().header;
    if (static_cast<int32_t>(header.sequence - before.sequence) <= 0) {
      check().Fail("event numbers ascend",
                   absl::StrCat(header.sequence, " after ", before.sequence), "6");
    }
    if (header.time_ns < before.time_ns) {
      check().Fail("the device's clock never goes back in a session",
                   absl::StrCat(header.time_ns, " after ", before.time_ns), "6");
    }
  }
  if (header.credit_limit < told_) {
    check().Fail("credit_limit never falls", absl::StrCat(header.credit_limit, " after ", told_),
                 "7");
  }
  // Bytes in flight may be consumed before their transfer is reported as ended.
  const uint64_t most = sent_ + kVerifyTransferBytes + capabilities().fixed.receive_buffer;
  if (header.credit_limit > most) {
    check().Fail(absl::StrCat("credit_limit is at most the bytes sent and the receive buffer, ",
                              sent_ + capabilities().fixed.receive_buffer),
                 absl::StrCat(header.credit_limit), "7");
  }
  told_ = std::max(told_, header.credit_limit);
  credit_limit_ = std::max(credit_limit_, told_);
  log_.push_back(std::move(event));
  if (log_.size() > kMostEvents) {
    check().Fail("fewer events", absl::StrCat(kMostEvents, " in one case"), "6");
  }
}

void Session::Step(sync::TimeNs until) {
  if (!ok()) return;
  TakeEvents();
  KeepAlive();
  if (!ok()) return;
  if (running_ && keepalive_) until = std::min(until, last_sent_ + kVerifyKeepaliveAfter);
  // Without credit no keep-alive is due, however late it is.
  if (until <= probe_.Now()) until = probe_.Now() + kMillisecond;
  probe_.Step(until);
  TakeEvents();
}

void Session::Pause(sync::TimeNs duration) {
  const sync::TimeNs end = probe_.Now() + duration;
  while (ok() && probe_.Now() < end) Step(end);
}

std::optional<Event> Session::Find(const std::function<bool(const Event&)>& is) const {
  for (size_t i = mark_; i < log_.size(); ++i) {
    if (is(log_[i])) return log_[i];
  }
  return std::nullopt;
}

size_t Session::Count(EventType type) const {
  return static_cast<size_t>(
      std::count_if(log_.begin() + static_cast<ptrdiff_t>(mark_), log_.end(),
                    [&](const Event& event) { return event.type() == type; }));
}

Event Session::Await(const std::string& expected, sync::TimeNs limit,
                     const std::function<bool(const Event&)>& is) {
  if (!gathered_.empty()) Settle();
  const sync::TimeNs deadline = probe_.Now() + limit;
  size_t looked = mark_;
  TakeEvents();
  while (ok()) {
    for (; looked < log_.size(); ++looked) {
      if (log_[looked].awaited || !is(log_[looked])) continue;
      log_[looked].awaited = true;
      return log_[looked];
    }
    if (probe_.Now() >= deadline) {
      check().Fail(absl::StrCat(expected, ", within ", limit / kMillisecond, " ms"), Recent());
      break;
    }
    Step(deadline);
  }
  return {};
}

}  // namespace voxeld::display::voxlink
