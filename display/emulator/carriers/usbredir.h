// The device's side of usbredir 0.7 (https://gitlab.freedesktop.org/spice/usbredir, its protocol
// document): presents a device model as a device that QEMU plugs into a virtual machine's xhci.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "absl/status/status.h"
#include "display/emulator/carriers/byte_stream.h"
#include "display/usb/device_model.h"

struct usbredirparser;

namespace voxeld::display::emulator {

// One connection. Single-threaded, as the model is; during its lifetime it receives the model's
// completions.
class UsbredirSession {
 public:
  // Takes ownership of the socket, and announces the device if it is plugged in.
  UsbredirSession(int fd, UsbDeviceModel& model);
  ~UsbredirSession();
  UsbredirSession(const UsbredirSession&) = delete;
  UsbredirSession& operator=(const UsbredirSession&) = delete;

  ByteStream& stream() { return stream_; }
  // Reads and executes packets. Any error ends the session: InvalidArgument for a protocol
  // violation, ResourceExhausted if more is pending than any host needs, Unavailable if the peer is
  // gone.
  absl::Status Receive();
  // Posts reads to the model for the endpoints that the peer listens to. Call it after each call of
  // the model.
  void ReadOn();
  // Notifies the peer that the model has been plugged in or unplugged.
  void SetPlugged(bool plugged);

 private:
  struct Callbacks;
  // One received packet, and how it is answered.
  struct Submitted {
    enum class Kind : uint8_t { kControl, kBulk, kInterruptOut, kInterruptIn, kInternal };
    Kind kind = Kind::kControl;
    uint8_t endpoint = 0;
    UsbSetup setup;
    std::vector<std::byte> out;
    uint64_t id = 0;      // the peer's
    uint32_t length = 0;  // bytes that it carries or requests
  };

  void Connect();
  void Submit(Submitted submitted, uint32_t length);
  // Sends the host controller's own requests (configuration, interface) to the model.
  void Request(UsbSetup setup);
  void ReadHaltedAgain();
  void AnswerInterrupt(const Submitted& submitted, TransferStatus status, uint32_t actual,
                       std::span<const std::byte> in);
  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in);

  ByteStream stream_;
  UsbDeviceModel& model_;
  const std::unique_ptr<usbredirparser, void (*)(usbredirparser*)> parser_;
  uint64_t next_ = 1;  // the model's ids
  std::map<uint64_t, Submitted> submitted_;
  size_t pending_bytes_ = 0;      // of all submitted_
  size_t budget_ = 0;             // bytes to read before others get their turn
  bool greeted_ = false;          // the peer has said which protocol it speaks
  bool connected_ = false;        // the peer knows of the device
  bool overrun_ = false;          // the peer has more pending than is allowed
  std::set<uint8_t> reading_;     // interrupt endpoints that the peer listens to
  std::set<uint8_t> halted_;      // those of them that stalled and were not cleared since
  std::vector<uint8_t> to_read_;  // those of them without a pending read
  std::map<uint8_t, uint16_t> packets_;
};

}  // namespace voxeld::display::emulator
