// A voxlink 1.0 display as a USB device model: descriptors, requests, receive buffer and credits,
// event queue; VoxlinkScreen computes the light. It follows docs/protocols/voxlink.md and is the
// reference for firmware.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "display/api/display.h"
#include "display/drivers/voxlink/capabilities.h"
#include "display/emulator/descriptors.h"
#include "display/emulator/voxlink_screen.h"
#include "display/sync/clock.h"
#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

struct VoxlinkDeviceConfig {
  Geometry geometry;  // must be valid; the grid is not used
  double volumes_per_second = 30;
  uint8_t formats = 0x1F;  // bit n: PixelFormat n; with an odd height kHub75 is left out
  uint8_t max_sub_frames = 64;
  uint32_t receive_buffer = 4u << 20;
  uint32_t max_payload = 65536;
  uint64_t bytes_per_second = 0;  // rate at which the receive buffer is emptied; 0: at once
  bool watchdog = true;
  bool brightness = true, power_limit = true;  // whether it supports them
  UsbSpeed speed = UsbSpeed::kSuper;
  int16_t temperature = 300;  // 0.1 °C
  std::string serial = "simulated";
};

class VoxlinkDevice final : public UsbDeviceModel {
 public:
  VoxlinkDevice(VoxlinkDeviceConfig config, sync::Clock& clock);

  void SetComplete(Complete complete) override { complete_ = std::move(complete); }
  void Submit(const Urb& urb) override;
  bool Unlink(uint64_t id) override;
  void Tick() override;
  sync::TimeNs NextTimeout() const override;
  UsbSpeed speed() const override { return config_.speed; }
  void Reset() override;
  void SetPlugged(bool plugged) override;
  bool plugged() const override { return plugged_; }
  uint32_t plugs() const override { return plugs_; }

  // Returns what an eye sees at this moment: nothing while the display is dark.
  std::optional<DecodedVolume> Seen() const;
  const VoxlinkScreen& screen() const { return screen_; }
  double brightness() const { return brightness_ / 65535.0; }
  uint32_t power_limit_mw() const { return power_limit_mw_; }
  const FrameLayout& layout() const { return layout_; }
  uint64_t bytes_received() const { return received_; }
  // Bytes received beyond the credit given: an error of the host.
  uint64_t credit_excess() const { return credit_excess_; }

 private:
  struct Event {
    voxlink::EventType type;
    uint8_t flags;
    std::vector<std::byte> body;
  };
  struct Waiting {  // an URB that could not be served yet
    uint64_t id;
    std::span<const std::byte> out;
    uint32_t length;
  };

  sync::TimeNs DeviceNow() const { return clock_.Now() - boot_; }
  uint64_t CreditLimit() const { return consumed_ + config_.receive_buffer; }

  void Control(const Urb& urb);
  // Returns the reply to an IN request, or nothing to stall it.
  std::optional<std::vector<std::byte>> ReadRequest(const UsbSetup& setup);
  std::optional<std::vector<std::byte>> Descriptor(uint16_t value) const;
  bool WriteRequest(const UsbSetup& setup, std::span<const std::byte> data);
  void ResetMode();
  // Ends the session and resets all settings; pending URBs end as `status`.
  void Forget(TransferStatus status);
  bool SetMode(std::span<const std::byte> data);
  void StartSession();
  void StopSession();
  std::vector<std::byte> StatusBytes();  // announces credit, as an event does

  void AcceptBulk();  // moves bytes from waiting URBs into the receive buffer
  void Receive(std::span<const std::byte> bytes);
  void DrainBuffer();  // moves bytes from the receive buffer to the screen, at the limited rate
  void Queue(voxlink::EventType type, uint8_t flags, std::span<const std::byte> body);
  void DeliverEvents();
  void DeliverEvent(const Event& event);

  const VoxlinkDeviceConfig config_;
  const DescriptorSet descriptors_;
  const std::vector<std::byte> capabilities_;
  sync::Clock& clock_;
  Complete complete_;
  bool plugged_ = true;
  uint32_t plugs_ = 1;
  sync::TimeNs boot_;

  uint8_t configuration_ = 0;
  std::set<uint8_t> halted_;
  std::deque<Waiting> bulk_, interrupt_;  // pending URBs

  FrameLayout layout_;
  uint32_t rate_mhz_ = 0;
  uint16_t brightness_ = 65535;
  uint32_t power_limit_mw_ = 0;
  VoxlinkScreen screen_;

  std::vector<std::byte> buffer_;  // received but not consumed, from buffer_begin_ on
  size_t buffer_begin_ = 0;
  sync::TimeNs drained_at_ = 0;  // the rate is counted from here
  uint64_t received_ = 0, consumed_ = 0, announced_ = 0, credit_excess_ = 0;

  std::deque<Event> events_;
  uint32_t event_sequence_ = 0;
  sync::TimeNs health_at_ = 0;
};

}  // namespace voxeld::display::emulator
