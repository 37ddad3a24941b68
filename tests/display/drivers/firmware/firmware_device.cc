#include "tests/display/drivers/firmware/firmware_device.h"

#include <algorithm>

#include "display/drivers/voxlink/protocol.h"
#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

using voxlink::kBulkOut;
using voxlink::kInterruptIn;

const uint8_t* Bytes(std::span<const std::byte> bytes) {
  return reinterpret_cast<const uint8_t*>(bytes.data());
}

}  // namespace

FirmwareDevice::FirmwareDevice(const voxlink::DeviceCapabilities& capabilities, UsbSpeed speed,
                               sync::Clock& clock)
    : speed_(speed),
      descriptors_(emulator::MakeDescriptors(speed, "firmware")),
      capabilities_(voxlink::EncodeCapabilities(capabilities)),
      clock_(clock) {
  const auto fixed = voxlink::Load<voxlink::Capabilities>(capabilities_);
  const size_t pictures = size_t{fixed.slices} * fixed.max_sub_frames;
  // The largest of all formats: eight bit planes, rows padded to bytes.
  const size_t volume = pictures * 24 * ((fixed.width + 7) / 8) * fixed.height;
  volumes_.resize(3 * volume);
  payload_.resize(fixed.max_payload);
  filled_.resize(pictures);
  const voxlink_memory memory = {.capabilities = Bytes(capabilities_),
                                 .volumes = volumes_.data(),
                                 .volume_bytes = volume,
                                 .filled = filled_.data(),
                                 .most_pictures = static_cast<uint32_t>(pictures),
                                 .payload = payload_.data()};
  EXPECT_TRUE(voxlink_init(&core_, &memory));
  core_.temperature = 250;
}

std::span<const std::byte> FirmwareDevice::Light() const {
  const uint8_t* const light = voxlink_light(&core_);
  if (light == nullptr || core_.brightness == 0) return {};
  return {reinterpret_cast<const std::byte*>(light), size_t{core_.pictures} * core_.picture_bytes};
}

void FirmwareDevice::Submit(const Urb& urb) {
  if (!plugged_) return complete_(urb.id, TransferStatus::kDisconnected, 0, {});
  Tick();
  if (urb.endpoint == 0) {
    Control(urb);
  } else if (halted_.contains(urb.endpoint)) {
    return complete_(urb.id, TransferStatus::kStall, 0, {});
  } else if (urb.endpoint == kBulkOut) {
    voxlink_bulk(&core_, Now(), Bytes(urb.out), urb.out.size());
    complete_(urb.id, TransferStatus::kOk, static_cast<uint32_t>(urb.out.size()), {});
  } else if (urb.endpoint == kInterruptIn) {
    interrupt_.push_back({urb.id, urb.length});
  } else {
    return complete_(urb.id, TransferStatus::kStall, 0, {});
  }
  DeliverEvents();
}

bool FirmwareDevice::Unlink(uint64_t id) {
  return std::erase_if(interrupt_, [id](const Waiting& urb) { return urb.id == id; }) > 0;
}

void FirmwareDevice::Tick() {
  if (!plugged_ || !core_.running) return;
  // The firmware is called at each of these times; here, at all that have passed, in order.
  while (next_sweep_ <= Now()) {
    voxlink_tick(&core_, next_sweep_);
    voxlink_sweep(&core_, next_sweep_);
    next_sweep_ += Period();
  }
  voxlink_tick(&core_, Now());
  DeliverEvents();
}

sync::TimeNs FirmwareDevice::NextTimeout() const {
  if (!plugged_ || !core_.running) return sync::kNever;
  const auto tick = clock_.Now() + 2 * sync::kMillisecond;
  return std::min(static_cast<sync::TimeNs>(next_sweep_), tick);
}

void FirmwareDevice::DeliverEvents() {
  uint8_t event[64];
  while (!interrupt_.empty()) {
    const size_t length = voxlink_event(&core_, Now(), event);
    if (length == 0) return;
    errors_ += event[0] == static_cast<uint8_t>(voxlink::EventType::kError) ? 1 : 0;
    const Waiting urb = interrupt_.front();
    interrupt_.pop_front();
    const std::span<const std::byte> bytes = std::as_bytes(std::span(event, length));
    const size_t count = std::min<size_t>(length, urb.length);
    complete_(urb.id,
              length > urb.length   ? TransferStatus::kOverflow
              : length < urb.length ? TransferStatus::kShort
                                    : TransferStatus::kOk,
              static_cast<uint32_t>(count), bytes.first(count));
  }
}

void FirmwareDevice::Answer(const Urb& urb, std::span<const std::byte> bytes) {
  const size_t count = std::min<size_t>({urb.setup.length, urb.length, bytes.size()});
  complete_(urb.id, count < urb.length ? TransferStatus::kShort : TransferStatus::kOk,
            static_cast<uint32_t>(count), bytes.first(count));
}

bool FirmwareDevice::Standard(const Urb& urb) {
  const UsbSetup& setup = urb.setup;
  const size_t index = setup.value & 0xFF;
  const auto none = [&] { complete_(urb.id, TransferStatus::kOk, 0, {}); };
  const auto word = [&](uint8_t low) {
    const std::byte bytes[] = {std::byte{low}, std::byte{0}};
    Answer(urb, bytes);
  };
  switch (setup.request_type << 8 | setup.request) {
    case 0x8006:
      if (setup.value >> 8 == 1) return Answer(urb, descriptors_.device), true;
      if (setup.value == 0x0200) return Answer(urb, descriptors_.configuration), true;
      if (setup.value >> 8 == 15) return Answer(urb, descriptors_.bos), true;
      if (setup.value >> 8 != 3 || index >= descriptors_.strings.size()) return false;
      return Answer(urb, descriptors_.strings[index]), true;
    case 0x8000:  // GET_STATUS: self-powered
      return word(1), true;
    case 0x8200:
      return word(halted_.contains(setup.index & 0xFF) ? 1 : 0), true;
    case 0xC000 | voxlink::kMsVendorCode:
      if (setup.index != voxlink::kMsDescriptorIndex) return false;
      return Answer(urb, descriptors_.ms_os_20), true;
    case 0x0009:
      halted_.clear();
      voxlink_stop(&core_);
      return none(), true;
    case 0x0201:
      halted_.erase(setup.index & 0xFF);
      return none(), true;
    case 0x0203:
      halted_.insert(setup.index & 0xFF);
      return none(), true;
    default:
      return false;
  }
}

void FirmwareDevice::Control(const Urb& urb) {
  const UsbSetup& setup = urb.setup;
  if (Standard(urb)) return;
  const bool in = (setup.request_type & 0x80) != 0;
  const uint8_t* answer = nullptr;
  int32_t length = -1;
  if (in || urb.out.size() == setup.length) {
    length =
        voxlink_request(&core_, Now(), setup.request_type, setup.request, setup.value, setup.index,
                        Bytes(urb.out), static_cast<uint16_t>(urb.out.size()), &answer);
  }
  if (length < 0) return complete_(urb.id, TransferStatus::kStall, 0, {});
  if (setup.request_type == voxlink::kRequestOut &&
      setup.request == static_cast<uint8_t>(voxlink::Request::kStart)) {
    next_sweep_ = Now() + Period();
  }
  if (in) {
    return Answer(urb, std::as_bytes(std::span(answer, static_cast<size_t>(length))));
  }
  complete_(urb.id, TransferStatus::kOk, static_cast<uint32_t>(urb.out.size()), {});
}

void FirmwareDevice::Cancel(TransferStatus status) {
  voxlink_reset(&core_);
  halted_.clear();
  std::deque<Waiting> pending;
  pending.swap(interrupt_);
  for (const Waiting& urb : pending) complete_(urb.id, status, 0, {});
}

void FirmwareDevice::Reset() { Cancel(TransferStatus::kCancelled); }

void FirmwareDevice::SetPlugged(bool plugged) {
  if (plugged == plugged_) return;
  plugged_ = plugged;
  plugs_ += plugged ? 1 : 0;
  Cancel(TransferStatus::kDisconnected);
}

}  // namespace voxeld::display
