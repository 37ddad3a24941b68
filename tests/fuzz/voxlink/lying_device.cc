#include "tests/fuzz/voxlink/lying_device.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "display/crc/crc32c.h"
#include "display/drivers/voxlink/protocol.h"

namespace voxeld::fuzz {

using display::TransferStatus;
using display::Urb;
namespace voxlink = display::voxlink;

namespace {

// How many of 256 answers are true, by rarity.
constexpr std::array<uint8_t, 4> kTrueBelow = {0x80, 0xD0, 0xF0, 0xFC};
constexpr size_t kMostLate = 32;

template <typename T>
void Store(std::span<std::byte> bytes, size_t at, const T& value) {
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

ExchangeKind KindOf(const Urb& urb) {
  if (urb.endpoint == voxlink::kBulkOut) return ExchangeKind::kPackets;
  if (urb.endpoint != 0) return ExchangeKind::kEvent;
  if ((urb.setup.request_type & 0x80) == 0) return ExchangeKind::kWrite;
  if (urb.setup.request_type != voxlink::kRequestIn) return ExchangeKind::kConfiguration;
  return urb.setup.request == static_cast<uint8_t>(voxlink::Request::kGetStatus)
             ? ExchangeKind::kStatus
             : ExchangeKind::kCapabilities;
}

// Renumbers packets that are whole in one transfer, which is how the driver sends them.
void Renumber(std::vector<std::byte>& bytes, uint32_t shift) {
  size_t at = 0;
  while (bytes.size() - at >= sizeof(voxlink::PacketHeader)) {
    const auto packet = std::span(bytes).subspan(at);
    auto header = voxlink::Load<voxlink::PacketHeader>(packet);
    if (header.length > packet.size() - sizeof(header)) break;
    header.sequence += shift;
    header.header_crc =
        display::Crc32c(std::as_bytes(std::span(&header, 1)).first(voxlink::kHeaderCrcOffset));
    Store(packet, 0, header);
    at += sizeof(header) + header.length;
  }
}

}  // namespace

void LyingDevice::SetComplete(Complete complete) {
  complete_ = std::move(complete);
  device_->SetComplete([this](uint64_t id, TransferStatus status, uint32_t actual,
                              std::span<const std::byte> in) { Answer(id, status, actual, in); });
}

void LyingDevice::Submit(const Urb& urb) {
  Asked& asked = asked_[urb.id];
  asked = {.in = urb.length, .out = urb.out.size(), .kind = KindOf(urb)};
  Urb passed = urb;
  if (asked.kind == ExchangeKind::kPackets && !urb.out.empty()) {
    const bool damage =
        ways_.rarity > 0 && !truthful_ && script_.Byte() >= 0xC0 + kTrueBelow[ways_.rarity] / 4;
    if (damage || ways_.sequence_shift != 0) {
      asked.copy.assign(urb.out.begin(), urb.out.end());
      if (ways_.sequence_shift != 0) Renumber(asked.copy, ways_.sequence_shift);
      if (damage) {
        asked.copy[script_.Below(65536) % asked.copy.size()] ^=
            std::byte{1} << static_cast<int>(script_.Byte() % 8);
        asked.damaged = true;
      }
      passed.out = asked.copy;
    }
  }
  device_->Submit(passed);
}

bool LyingDevice::Unlink(uint64_t id) {
  if (std::erase_if(late_, [id](const Late& late) { return late.id == id; }) > 0) return true;
  if (!device_->Unlink(id)) return false;
  asked_.erase(id);
  return true;
}

void LyingDevice::Tick() {
  while (true) {
    const sync::TimeNs now = clock_.Now();
    const auto due = std::find_if(late_.begin(), late_.end(),
                                  [now](const Late& late) { return late.due <= now; });
    if (due == late_.end()) break;
    const Late late = std::move(*due);
    late_.erase(due);
    complete_(late.id, late.status, late.actual, late.in);
  }
  device_->Tick();
}

sync::TimeNs LyingDevice::NextTimeout() const {
  sync::TimeNs next = device_->NextTimeout();
  for (const Late& late : late_) next = std::min(next, late.due);
  return next;
}

void LyingDevice::EndLate(TransferStatus status) {
  for (const Late& late : std::exchange(late_, {})) complete_(late.id, status, 0, {});
}

void LyingDevice::Reset() {
  EndLate(TransferStatus::kCancelled);
  device_->Reset();
}

void LyingDevice::SetPlugged(bool plugged) {
  if (!plugged) EndLate(TransferStatus::kDisconnected);
  device_->SetPlugged(plugged);
}

void LyingDevice::Shift(ExchangeKind kind, std::span<std::byte> told) const {
  if (kind == ExchangeKind::kStatus && told.size() >= sizeof(voxlink::Status)) {
    auto status = voxlink::Load<voxlink::Status>(told);
    status.event_sequence += ways_.sequence_shift;
    status.time_ns += ways_.time_shift;
    status.shown_start_ns += ways_.time_shift;
    Store(told, 0, status);
  } else if (kind == ExchangeKind::kEvent && told.size() >= sizeof(voxlink::EventHeader)) {
    auto header = voxlink::Load<voxlink::EventHeader>(told);
    header.sequence += ways_.sequence_shift;
    header.time_ns += ways_.time_shift;
    Store(told, 0, header);
    const auto body = told.subspan(sizeof(header));
    const auto type = static_cast<voxlink::EventType>(header.type);
    if (type == voxlink::EventType::kSweep && body.size() >= sizeof(voxlink::SweepEvent)) {
      auto sweep = voxlink::Load<voxlink::SweepEvent>(body);
      sweep.start_ns += ways_.time_shift;
      Store(body, 0, sweep);
    } else if (type == voxlink::EventType::kShown && body.size() >= sizeof(voxlink::ShownEvent)) {
      auto shown = voxlink::Load<voxlink::ShownEvent>(body);
      shown.start_ns += ways_.time_shift;
      Store(body, 0, shown);
    }
  }
}

void LyingDevice::Answer(uint64_t id, TransferStatus status, uint32_t actual,
                         std::span<const std::byte> in) {
  const Asked asked = std::exchange(asked_[id], {});
  asked_.erase(id);
  std::vector<std::byte> told(in.begin(), in.end());
  Shift(asked.kind, told);
  ExchangeOutcome outcome = ExchangeOutcome::kAccepted;
  if (truthful_ || !device_->plugged()) {
    complete_(id, status, actual, told);
  } else {
    outcome = Lie(id, asked, status, actual, std::move(told));
  }
  if (asked.damaged && outcome == ExchangeOutcome::kAccepted) outcome = ExchangeOutcome::kDamaged;
  CountExchange(asked.kind, outcome);
}

void LyingDevice::Tell(uint64_t id, const Asked& asked, std::vector<std::byte> told) {
  told.resize(std::min(told.size(), asked.in));
  complete_(id, told.size() < asked.in ? TransferStatus::kShort : TransferStatus::kOk,
            static_cast<uint32_t>(told.size()), told);
}

ExchangeOutcome LyingDevice::Lie(uint64_t id, const Asked& asked, TransferStatus status,
                                 uint32_t actual, std::vector<std::byte> told) {
  uint8_t lie = script_.Byte();
  if (lie < kTrueBelow[ways_.rarity]) {
    if (ways_.rarity > 0 && !told.empty()) before_[asked.kind] = told;
    complete_(id, status, actual, told);
    return ExchangeOutcome::kAccepted;
  }
  if (ways_.rarity > 0) {
    lie = script_.Byte();
    if (lie < 0x20 && late_.size() < kMostLate) {
      const sync::TimeNs due = clock_.Now() + (1 + script_.Byte()) * 8 * sync::kMillisecond;
      late_.push_back({due, id, status, actual, std::move(told)});
      return ExchangeOutcome::kDelayed;
    }
    if (asked.in > 0 && !told.empty() && lie < 0x80) {
      if (lie < 0x40) {
        for (int i = lie & 7; i >= 0; --i) {
          told[script_.Below(65536) % told.size()] ^= std::byte{1}
                                                      << static_cast<int>(script_.Byte() % 8);
        }
        Tell(id, asked, std::move(told));
        return ExchangeOutcome::kFlipped;
      }
      if (lie < 0x50 && before_.contains(asked.kind)) {
        Tell(id, asked, before_[asked.kind]);
        return ExchangeOutcome::kReplayed;
      }
      if (lie < 0x68 && asked.kind == ExchangeKind::kEvent &&
          told.size() >= sizeof(voxlink::EventHeader)) {
        auto header = voxlink::Load<voxlink::EventHeader>(told);
        header.sequence += static_cast<uint32_t>(static_cast<int8_t>(script_.Byte()));
        Store(std::span(told), 0, header);
        Tell(id, asked, std::move(told));
        return ExchangeOutcome::kSequence;
      }
      told.resize(script_.Below(65536) % told.size());
      Tell(id, asked, std::move(told));
      return ExchangeOutcome::kShort;
    }
    lie |= 0x80;
  }
  if (lie < 0x90) {  // it ends with another status
    complete_(id, static_cast<TransferStatus>(script_.Byte() % 7), 0, {});
    return ExchangeOutcome::kFailed;
  }
  if (asked.in == 0) {
    complete_(id, status, static_cast<uint32_t>(script_.Below(65536) % (asked.out + 1)), {});
    return ExchangeOutcome::kTookLess;
  }
  if (lie < 0xC0) {
    for (int i = lie & 7; i >= 0; --i) {
      const size_t at = script_.Byte();
      const auto value = static_cast<std::byte>(script_.Byte());
      if (at < told.size()) told[at] = value;
    }
    Tell(id, asked, std::move(told));
    return ExchangeOutcome::kBytes;
  }
  if (lie < 0xE0) {
    const size_t at = size_t{4} * (script_.Byte() % 32);
    const uint64_t value = script_.Number(4);
    for (size_t i = 0; i < 4 && at + i < told.size(); ++i) {
      told[at + i] = static_cast<std::byte>(value >> 8 * i);
    }
    Tell(id, asked, std::move(told));
    return ExchangeOutcome::kNumber;
  }
  const std::string text = script_.Text();
  told.clear();
  for (const char c : text) told.push_back(static_cast<std::byte>(c));
  Tell(id, asked, std::move(told));
  return ExchangeOutcome::kGarbage;
}

}  // namespace voxeld::fuzz
