#include "tests/fuzz/voxlink/device_session.h"

#include <utility>

#include "display/drivers/voxlink/protocol.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/voxlink/packets.h"

namespace voxeld::fuzz {

using display::TransferStatus;
using display::Urb;
using display::UsbSetup;
namespace voxlink = display::voxlink;

namespace {

constexpr size_t kMostPending = 64;  // in URBs

}  // namespace

DeviceSession::DeviceSession(display::UsbDeviceModel& model, sync::FakeClock& clock,
                             ExchangeKind kind, std::function<void()> look)
    : model_(model), clock_(clock), kind_(kind), look_(std::move(look)) {
  model_.SetComplete([this](uint64_t id, TransferStatus status, uint32_t actual,
                            std::span<const std::byte> in) { Complete(id, status, actual, in); });
}

void DeviceSession::Run(Script script) {
  for (int step = 0; step < MostSteps(256) && !script.done(); ++step) {
    Step(script);
    look_();
  }
  model_.SetPlugged(false);
  EXPECT_THAT_HOLDS(pending_.empty(), pending_.size(), " transfers outlive the plug");
  look_();
}

void DeviceSession::Step(Script& script) {
  switch (script.Byte() % 12) {
    case 0: {  // any request
      const uint8_t type = script.Byte(), request = script.Byte();
      const auto value = static_cast<uint16_t>(script.Number(2));
      const auto length = static_cast<uint16_t>(script.Number(2));
      Request(type, request, value, length, BytesOf(script.Text()));
      break;
    }
    case 1: {  // one of the protocol's, with its data
      const auto request = static_cast<uint8_t>(1 + script.Byte() % 9);
      const auto value = static_cast<uint16_t>(script.Number(2));
      const std::string data = script.Text();
      const bool in = request <= 2 || request == 4;
      Request(in ? voxlink::kRequestIn : voxlink::kRequestOut, request, value,
              in ? 4096 : static_cast<uint16_t>(data.size()),
              in ? std::vector<std::byte>() : BytesOf(data));
      break;
    }
    case 2: {  // set-up: SET_CONFIGURATION, START
      Request(0x00, 0x09, 1, 0, {});
      Request(voxlink::kRequestOut, static_cast<uint8_t>(voxlink::Request::kStart), 0, 0, {});
      writer_.Restart();
      break;
    }
    case 3:
    case 4:
    case 5: {  // packets
      std::vector<std::byte> bytes;
      for (int i = script.Byte() % 8; i >= 0; --i) AppendPacket(script, writer_, bytes);
      Urb urb;
      urb.endpoint = voxlink::kBulkOut;
      Submit(urb, std::move(bytes));
      break;
    }
    case 6:
    case 7:  // reads
      for (int i = script.Byte() % 8; i >= 0; --i) {
        Urb urb;
        urb.endpoint = voxlink::kInterruptIn;
        urb.length = voxlink::kEventSize;
        Submit(urb, {});
      }
      break;
    case 8:
    case 9:  // time
      clock_.Advance(script.Below(65536) * sync::TimeNs{50'000});
      model_.Tick();
      break;
    case 10:
      if (pending_.empty()) break;
      {
        auto it = pending_.begin();
        std::advance(it, script.Byte() % pending_.size());
        const uint64_t id = it->first;
        if (model_.Unlink(id)) pending_.erase(id);
      }
      break;
    default:
      switch (script.Byte() % 4) {
        case 0:
          model_.Reset();
          EXPECT_THAT_HOLDS(pending_.empty());
          break;
        case 1:
          model_.SetPlugged(false);
          EXPECT_THAT_HOLDS(pending_.empty());
          break;
        case 2:
          model_.SetPlugged(true);
          break;
        default: {  // an endpoint that does not exist, or a read of another length
          Urb urb;
          urb.endpoint = script.Byte();
          urb.length = (urb.endpoint & 0x80) != 0 ? script.Byte() : 0;
          if (urb.endpoint != 0 && urb.endpoint != 0x80) Submit(urb, BytesOf(script.Text()));
          break;
        }
      }
      numbered_ = false;
      break;
  }
}

void DeviceSession::Request(uint8_t type, uint8_t request, uint16_t value, uint16_t length,
                            std::vector<std::byte> out) {
  Urb urb;
  const bool in = (type & 0x80) != 0;
  if (in) out.clear();
  urb.setup = {.request_type = type,
               .request = request,
               .value = value,
               .length = in ? length : static_cast<uint16_t>(out.size())};
  urb.length = in ? length : 0;
  numbered_ = false;
  Submit(urb, std::move(out));
}

void DeviceSession::Submit(Urb urb, std::vector<std::byte> out) {
  if (pending_.size() >= kMostPending) return;
  urb.id = next_id_++;
  Pending& pending = pending_[urb.id];
  pending = {.out = std::move(out), .endpoint = urb.endpoint, .length = urb.length};
  urb.out = pending.out;
  model_.Submit(urb);
}

void DeviceSession::Complete(uint64_t id, TransferStatus status, uint32_t actual,
                             std::span<const std::byte> in) {
  const auto it = pending_.find(id);
  EXPECT_THAT_HOLDS(it != pending_.end(), "a transfer is completed that is not under way");
  const Pending pending = std::move(it->second);
  pending_.erase(it);
  CountExchange(kind_, status == TransferStatus::kOk || status == TransferStatus::kShort);
  if (pending.length > 0) {
    EXPECT_THAT_HOLDS(in.size() <= pending.length);
    EXPECT_THAT_HOLDS(in.empty() || actual == in.size());
  } else {
    EXPECT_THAT_HOLDS(in.empty() && actual <= pending.out.size());
  }
  if (pending.endpoint == voxlink::kInterruptIn && !in.empty() &&
      pending.length == voxlink::kEventSize) {
    EXPECT_THAT_HOLDS(status == TransferStatus::kOk || status == TransferStatus::kShort);
    CheckEvent(in);
  }
}

void DeviceSession::CheckEvent(std::span<const std::byte> bytes) {
  EXPECT_THAT_HOLDS(bytes.size() >= sizeof(voxlink::EventHeader));
  const auto header = voxlink::Load<voxlink::EventHeader>(bytes);
  EXPECT_THAT_HOLDS(header.length == bytes.size());
  EXPECT_THAT_HOLDS(header.type >= 1 && header.type <= 13, int{header.type});
  // Numbers of events that had no room remain unused. A new session restarts its numbers; events of
  // the previous one may have arrived after it was requested.
  const bool anew = header.type == static_cast<uint8_t>(voxlink::EventType::kReady);
  EXPECT_THAT_HOLDS(!numbered_ || anew || static_cast<int32_t>(header.sequence - next_event_) >= 0,
                    "an event's number does not ascend");
  next_event_ = header.sequence + 1;
  numbered_ = true;
}

}  // namespace voxeld::fuzz
