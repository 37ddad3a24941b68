// The device's side of usbredir 0.7 (https://gitlab.freedesktop.org/spice/usbredir, its protocol
// document): a device model as what QEMU plugs into a virtual machine's xhci.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "display/emulator/carriers/byte_stream.h"
#include "display/usb/device_model.h"

struct usbredirparser;

namespace voxeld::display::emulator {

// One connection. Single-threaded, as the model is: while it lives the model completes to it.
class UsbredirSession {
 public:
  // Takes the socket, and says that the device is there if it is.
  UsbredirSession(int fd, UsbDeviceModel& model);
  ~UsbredirSession();
  UsbredirSession(const UsbredirSession&) = delete;
  UsbredirSession& operator=(const UsbredirSession&) = delete;

  ByteStream& stream() { return stream_; }
  absl::Status Receive();
  // Tells the other side; the model has been plugged or pulled.
  void SetPlugged(bool plugged);

 private:
  struct Callbacks;
  // What came as one packet, and how it is answered.
  struct Submitted {
    enum class Kind : uint8_t { kControl, kBulk, kInterruptOut, kInterruptIn, kInternal };
    Kind kind = Kind::kControl;
    uint8_t endpoint = 0;
    UsbSetup setup;
    std::vector<std::byte> out;
    uint64_t id = 0;  // the other side's
  };

  void Connect();
  void Submit(Submitted submitted, uint32_t length);
  // The host controller's own requests (configuration, interface), carried to the model.
  void Request(UsbSetup setup);
  void ReadInterrupts(uint8_t endpoint);
  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in);

  ByteStream stream_;
  UsbDeviceModel& model_;
  const std::unique_ptr<usbredirparser, void (*)(usbredirparser*)> parser_;
  uint64_t next_ = 1;  // the model's ids
  std::map<uint64_t, Submitted> submitted_;
  std::map<uint8_t, bool> reading_;  // interrupt endpoints that the other side listens to
  std::map<uint8_t, uint16_t> packets_;
};

}  // namespace voxeld::display::emulator
