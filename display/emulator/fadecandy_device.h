// One Fadecandy board as a USB device model: descriptors, requests, and the endpoint with its flow
// control; FadecandyLight computes the light. It follows docs/protocols/fadecandy.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "display/emulator/fadecandy_light.h"
#include "display/sync/clock.h"
#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

struct FadecandyDeviceConfig {
  std::string serial = "SIMULATED";
  sync::TimeNs refresh_ns = 2'500'000;  // at least a millisecond
};

class FadecandyDevice final : public UsbDeviceModel {
 public:
  FadecandyDevice(FadecandyDeviceConfig config, sync::Clock& clock);

  void SetComplete(Complete complete) override { complete_ = std::move(complete); }
  void Submit(const Urb& urb) override;
  bool Unlink(uint64_t id) override;
  void Tick() override;
  sync::TimeNs NextTimeout() const override;
  UsbSpeed speed() const override { return UsbSpeed::kFull; }
  void Reset() override;
  void SetPlugged(bool plugged) override;
  bool plugged() const override { return plugged_; }
  uint32_t plugs() const override { return plugs_; }

  // Returns R, G, B of the 512 pixels as lit by the last refresh; black without power.
  std::span<const uint8_t, fadecandy::kFrameBytes> Output() const { return light_.Output(); }
  const FadecandyLight& light() const { return light_; }
  // Counted since it was plugged in: packets accepted, and packets shorter than 64 bytes, which are
  // dropped.
  uint64_t packets() const { return packets_; }
  uint64_t short_packets() const { return short_packets_; }

 private:
  struct Pending {
    uint64_t id;
    std::span<const std::byte> out;
    size_t taken;  // consumed bytes of `out`
  };

  void Control(const Urb& urb);
  std::optional<std::vector<std::byte>> ReadRequest(const UsbSetup& setup) const;
  std::optional<std::vector<std::byte>> Descriptor(uint16_t value) const;
  bool WriteRequest(const UsbSetup& setup);
  // Accepts packets of pending transfers, until one has to wait.
  void Accept();
  // Resets to the state after power-up; pending URBs end as `status`.
  void Forget(TransferStatus status);

  const FadecandyDeviceConfig config_;
  sync::Clock& clock_;
  Complete complete_;
  bool plugged_ = true;
  uint32_t plugs_ = 1;
  sync::TimeNs boot_;
  sync::TimeNs refresh_at_;
  uint8_t configuration_ = 0;
  std::set<uint8_t> halted_;
  std::deque<Pending> bulk_;
  FadecandyLight light_;
  uint64_t packets_ = 0, short_packets_ = 0;
};

}  // namespace voxeld::display::emulator
