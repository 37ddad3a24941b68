// The device's end of a USB cable in software, as an emulated device appears to its carrier (this
// process, usbip, a fake kernel).
//
// A model is single-threaded and does no I/O: all calls come from one thread at a time, and answers
// are given through `complete`, from inside any call. Its time is a Clock's; it acts only when
// called.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

struct Urb {
  uint64_t id = 0;
  uint8_t endpoint = 0;            // with bit 7 for IN; 0 for control
  UsbSetup setup;                  // control only
  std::span<const std::byte> out;  // valid until the URB is complete or unlinked
  uint32_t length = 0;             // IN: bytes requested
  bool zero_packet = false;        // an empty packet follows `out`
};

enum class UsbSpeed : uint8_t { kFull, kHigh, kSuper };  // 12, 480, 5000 Mbit/s

// Returns the most bytes per second that bulk transfers can reach (USB 2.0, §5.8.4: 19 packets of
// 64 bytes a frame, 13 of 512 a microframe; USB 3.0: what hosts are known to reach).
constexpr uint64_t BulkBytesPerSecond(UsbSpeed speed) {
  return speed == UsbSpeed::kFull ? 1'216'000 : speed == UsbSpeed::kHigh ? 53'248'000 : 400'000'000;
}

class UsbDeviceModel {
 public:
  // `in` is valid during the call; `actual` also counts OUT bytes. Must not call the model.
  using Complete = std::function<void(uint64_t id, TransferStatus status, uint32_t actual,
                                      std::span<const std::byte> in)>;

  virtual ~UsbDeviceModel() = default;

  virtual void SetComplete(Complete complete) = 0;
  // Each URB is completed exactly once, unless it is unlinked before.
  virtual void Submit(const Urb& urb) = 0;
  // Returns true if the URB was pending: it will not complete.
  virtual bool Unlink(uint64_t id) = 0;
  // Does what is due by the clock.
  virtual void Tick() = 0;
  // Returns the latest time for the next Tick; kNever if nothing is due.
  virtual sync::TimeNs NextTimeout() const = 0;

  // The speed at which it enumerates; constant.
  virtual UsbSpeed speed() const = 0;
  // Resets the port: all URBs complete as kCancelled and the device forgets its state; handles to
  // it stay valid.
  virtual void Reset() = 0;

  // Plugs or unplugs the cable. Unplugging completes all URBs as kDisconnected, and the device
  // forgets its state.
  virtual void SetPlugged(bool plugged) = 0;
  virtual bool plugged() const = 0;
  // Returns how often it was plugged in: a handle to an earlier plug is stale.
  virtual uint32_t plugs() const = 0;
};

}  // namespace voxeld::display
