// The device's side of USB/IP (Linux, Documentation/usb/usbip_protocol.rst): presents a device
// model as a real device to the kernel's vhci_hcd, or to `usbip attach` on another machine.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/emulator/carriers/byte_stream.h"
#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

// The stream of URBs, after the handshake. Single-threaded, as the model is; during its lifetime it
// receives the model's completions.
class UsbipSession {
 public:
  // Takes ownership of the socket.
  UsbipSession(int fd, UsbDeviceModel& model);
  ~UsbipSession();
  UsbipSession(const UsbipSession&) = delete;
  UsbipSession& operator=(const UsbipSession&) = delete;

  ByteStream& stream() { return stream_; }
  // Reads and executes commands. Any error ends the session: InvalidArgument for a protocol
  // violation, Unimplemented for isochronous transfers, ResourceExhausted if more is pending than
  // any host needs, Unavailable if the peer is gone.
  absl::Status Receive();

 private:
  struct Submitted {
    bool in = false;
    uint32_t length = 0;
    std::vector<std::byte> out;
  };

  // Returns true if there was a command.
  absl::StatusOr<bool> ReceiveOne();
  void Submit(uint32_t number, bool in);
  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in);
  void Forget(std::map<uint64_t, Submitted>::iterator which);

  ByteStream stream_;
  UsbDeviceModel& model_;
  std::vector<std::byte> head_;     // of the command being received
  std::vector<std::byte> payload_;  // the data that follow it
  size_t have_ = 0;                 // bytes received of both
  std::map<uint64_t, Submitted> submitted_;
  size_t pending_bytes_ = 0;  // of all submitted_
};

// Answers the handshake of one connection (OP_REQ_DEVLIST, OP_REQ_IMPORT for bus id "1-1"), waiting
// at most `limit_ms` for the peer. Returns true if URBs follow, false if the peer only asked for
// the list. Errors: InvalidArgument for a protocol violation, NotFound for another device or one
// that is not plugged in, Unavailable if the peer is gone or silent.
absl::StatusOr<bool> AnswerUsbipHandshake(int fd, UsbDeviceModel& model, int limit_ms);

// Attaches to this kernel's vhci_hcd through sysfs; needs root. Returns the device's end of the
// socket.
absl::StatusOr<int> AttachToKernel(UsbSpeed speed);

}  // namespace voxeld::display::emulator
