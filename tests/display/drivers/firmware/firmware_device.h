// The C99 device of display/drivers/voxlink/firmware at the end of an in-process cable, surrounded
// by what a microcontroller's USB stack, clock and motor do.
#pragma once

#include <cstdint>
#include <deque>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "display/drivers/voxlink/capabilities.h"
#include "display/drivers/voxlink/firmware/voxlink_device.h"
#include "display/emulator/descriptors.h"
#include "display/sync/clock.h"
#include "display/usb/device_model.h"

namespace voxeld::display {

class FirmwareDevice final : public UsbDeviceModel {
 public:
  FirmwareDevice(const voxlink::DeviceCapabilities& capabilities, UsbSpeed speed,
                 sync::Clock& clock);

  void SetComplete(Complete complete) override { complete_ = std::move(complete); }
  void Submit(const Urb& urb) override;
  bool Unlink(uint64_t id) override;
  void Tick() override;
  sync::TimeNs NextTimeout() const override;
  UsbSpeed speed() const override { return speed_; }
  void Reset() override;
  void SetPlugged(bool plugged) override;
  bool plugged() const override { return plugged_; }
  uint32_t plugs() const override { return plugs_; }

  const voxlink_device& core() const { return core_; }
  // Returns the lit light: the bytes of all pictures; empty while it is dark.
  std::span<const std::byte> Light() const;
  // Returns the number of ERROR events that were sent.
  int errors() const { return errors_; }

 private:
  struct Waiting {
    uint64_t id;
    uint32_t length;
  };
  uint64_t Now() const { return static_cast<uint64_t>(clock_.Now()); }
  uint64_t Period() const { return 1'000'000'000'000 / core_.rate_mhz; }
  void Control(const Urb& urb);
  bool Standard(const Urb& urb);  // handles chapter 9 of USB, as a stack does
  void Answer(const Urb& urb, std::span<const std::byte> bytes);
  void DeliverEvents();
  void Cancel(TransferStatus status);

  const UsbSpeed speed_;
  const emulator::DescriptorSet descriptors_;
  const std::vector<std::byte> capabilities_;
  std::vector<uint8_t> volumes_, payload_;
  std::vector<uint32_t> filled_;
  sync::Clock& clock_;
  Complete complete_;
  voxlink_device core_;
  uint64_t next_sweep_ = 0;
  std::set<uint8_t> halted_;
  std::deque<Waiting> interrupt_;
  bool plugged_ = true;
  uint32_t plugs_ = 1;
  int errors_ = 0;
};

}  // namespace voxeld::display
