// A malicious voxlink host, controlled by a script, at the end of a device model's cable: requests,
// packets, reads, time, and the plug. After each step, the invariants of any device are checked.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "display/drivers/voxlink/packet.h"
#include "display/sync/fake_clock.h"
#include "display/usb/device_model.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {

class DeviceSession {
 public:
  // `model` and `clock` outlive it. `look` is called after each step; transfers are counted as
  // `kind`.
  DeviceSession(display::UsbDeviceModel& model, sync::FakeClock& clock, ExchangeKind kind,
                std::function<void()> look);

  void Run(Script script);

 private:
  struct Pending {
    std::vector<std::byte> out;
    uint8_t endpoint = 0;
    uint32_t length = 0;
  };

  void Step(Script& script);
  void Submit(display::Urb urb, std::vector<std::byte> out);
  void Complete(uint64_t id, display::TransferStatus status, uint32_t actual,
                std::span<const std::byte> in);
  void CheckEvent(std::span<const std::byte> bytes);
  void Request(uint8_t type, uint8_t request, uint16_t value, uint16_t length,
               std::vector<std::byte> out);

  display::UsbDeviceModel& model_;
  sync::FakeClock& clock_;
  const ExchangeKind kind_;
  const std::function<void()> look_;
  display::voxlink::PacketWriter writer_;
  uint64_t next_id_ = 1;
  std::map<uint64_t, Pending> pending_;
  uint32_t next_event_ = 0;
  bool numbered_ = false;  // events of this session have arrived
};

}  // namespace voxeld::fuzz
