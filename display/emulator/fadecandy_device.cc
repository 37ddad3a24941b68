#include "display/emulator/fadecandy_device.h"

#include <algorithm>
#include <utility>

#include "display/emulator/fadecandy_descriptors.h"

namespace voxeld::display::emulator {
namespace {

using fadecandy::kPacketBytes;
using Bytes = std::vector<std::byte>;

// If the clock jumps farther, the refreshes in between are not all performed.
constexpr sync::TimeNs kLongestCatchUp = sync::kSecond;

Bytes ListedBytes(std::initializer_list<uint32_t> values) {
  Bytes out;
  for (const uint32_t value : values) out.push_back(static_cast<std::byte>(value));
  return out;
}

}  // namespace

FadecandyDevice::FadecandyDevice(FadecandyDeviceConfig config, sync::Clock& clock)
    : config_(std::move(config)),
      clock_(clock),
      boot_(clock.Now()),
      refresh_at_(boot_ + config_.refresh_ns) {}

void FadecandyDevice::SetPlugged(bool plugged) {
  if (plugged == plugged_) return;
  plugged_ = plugged;
  if (plugged) ++plugs_;
  Forget(TransferStatus::kDisconnected);
}

void FadecandyDevice::Reset() { Forget(TransferStatus::kCancelled); }

void FadecandyDevice::Forget(TransferStatus status) {
  boot_ = clock_.Now();
  refresh_at_ = boot_ + config_.refresh_ns;
  configuration_ = 0;
  halted_.clear();
  light_ = FadecandyLight();
  packets_ = short_packets_ = 0;
  std::deque<Pending> pending;
  pending.swap(bulk_);
  for (const Pending& urb : pending) complete_(urb.id, status, 0, {});
}

void FadecandyDevice::Submit(const Urb& urb) {
  if (!plugged_) return complete_(urb.id, TransferStatus::kDisconnected, 0, {});
  Tick();
  if (urb.endpoint == 0) return Control(urb);
  if (urb.endpoint != fadecandy::kBulkOut || halted_.contains(urb.endpoint)) {
    return complete_(urb.id, TransferStatus::kStall, 0, {});
  }
  bulk_.push_back({urb.id, urb.out, 0});
  Accept();
}

bool FadecandyDevice::Unlink(uint64_t id) {
  return std::erase_if(bulk_, [id](const Pending& urb) { return urb.id == id; }) > 0;
}

void FadecandyDevice::Accept() {
  while (!bulk_.empty()) {
    Pending& urb = bulk_.front();
    while (urb.taken < urb.out.size()) {
      const auto rest = urb.out.subspan(urb.taken);
      if (rest.size() < kPacketBytes) {
        ++short_packets_;
        urb.taken = urb.out.size();
        break;
      }
      if (!light_.Take(rest.first<kPacketBytes>())) return;
      ++packets_;
      urb.taken += kPacketBytes;
    }
    const Pending done = urb;
    bulk_.pop_front();
    complete_(done.id, TransferStatus::kOk, static_cast<uint32_t>(done.taken), {});
  }
}

void FadecandyDevice::Tick() {
  if (!plugged_) return;
  const sync::TimeNs now = clock_.Now();
  if (now - refresh_at_ > kLongestCatchUp) {
    refresh_at_ += (now - kLongestCatchUp - refresh_at_) / config_.refresh_ns * config_.refresh_ns;
  }
  while (refresh_at_ <= now) {
    light_.Refresh((refresh_at_ - boot_) / sync::kMillisecond);
    refresh_at_ += config_.refresh_ns;
    Accept();
  }
}

sync::TimeNs FadecandyDevice::NextTimeout() const { return plugged_ ? refresh_at_ : sync::kNever; }

void FadecandyDevice::Control(const Urb& urb) {
  const UsbSetup& setup = urb.setup;
  if ((setup.request_type & 0x80) == 0) {
    const bool done = setup.length == 0 && urb.out.empty() && WriteRequest(setup);
    return complete_(urb.id, done ? TransferStatus::kOk : TransferStatus::kStall, 0, {});
  }
  const std::optional<Bytes> reply = ReadRequest(setup);
  if (!reply) return complete_(urb.id, TransferStatus::kStall, 0, {});
  const size_t count = std::min<size_t>({setup.length, urb.length, reply->size()});
  complete_(urb.id, count < urb.length ? TransferStatus::kShort : TransferStatus::kOk,
            static_cast<uint32_t>(count), std::span(*reply).first(count));
}

std::optional<Bytes> FadecandyDevice::ReadRequest(const UsbSetup& setup) const {
  switch (setup.request_type << 8 | setup.request) {
    case 0x8006:  // GET_DESCRIPTOR
      return FadecandyDescriptor(setup.value, config_.serial);
    case 0x8000:  // GET_STATUS: bus-powered
    case 0x8100:
      return ListedBytes({0, 0});
    case 0x8200:
      return ListedBytes({halted_.contains(setup.index & 0xFF) ? 1u : 0u, 0});
    case 0x8008:  // GET_CONFIGURATION
      return ListedBytes({configuration_});
    case 0x810A:  // GET_INTERFACE
      return ListedBytes({0});
    case fadecandy::kRequestIn << 8 | fadecandy::kMsVendorCode:
    case 0xC100 | fadecandy::kMsVendorCode:  // properties are requested from the interface
      return FadecandyMsDescriptor(setup.index);
    case fadecandy::kRequestIn << 8 | fadecandy::kGetCounter: {
      if (setup.index > fadecandy::kFrameCounter) return std::nullopt;
      const uint32_t count =
          setup.index == fadecandy::kRefreshCounter ? light_.refreshes() : light_.frames();
      return ListedBytes({count & 0xFF, count >> 8 & 0xFF, count >> 16 & 0xFF, count >> 24});
    }
    default:
      return std::nullopt;
  }
}

bool FadecandyDevice::WriteRequest(const UsbSetup& setup) {
  switch (setup.request_type << 8 | setup.request) {
    case 0x0009:  // SET_CONFIGURATION
      if (setup.value > 1) return false;
      configuration_ = static_cast<uint8_t>(setup.value);
      halted_.clear();
      return true;
    case 0x010B:  // SET_INTERFACE
      return setup.value == 0 && setup.index <= 1;
    case 0x0201:  // CLEAR_FEATURE(ENDPOINT_HALT)
      if (setup.value != 0) return false;
      halted_.erase(setup.index & 0xFF);
      return true;
    case 0x0203:  // SET_FEATURE(ENDPOINT_HALT)
      if (setup.value != 0) return false;
      halted_.insert(setup.index & 0xFF);
      return true;
    default:
      return false;
  }
}

}  // namespace voxeld::display::emulator
