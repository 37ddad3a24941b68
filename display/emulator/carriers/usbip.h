// The device's side of USB/IP (Linux, Documentation/usb/usbip_protocol.rst): a device model as what
// the kernel's vhci_hcd, or `usbip attach` on another machine, takes for a real device.
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

// The stream of URBs, after the handshake. Single-threaded, as the model is: while it lives the
// model completes to it.
class UsbipSession {
 public:
  // Takes the socket.
  UsbipSession(int fd, UsbDeviceModel& model);
  ~UsbipSession();
  UsbipSession(const UsbipSession&) = delete;
  UsbipSession& operator=(const UsbipSession&) = delete;

  ByteStream& stream() { return stream_; }
  // Reads commands and carries them out. Anything but OK ends the session: InvalidArgument for what is not
  // the protocol, Unimplemented for isochronous transfers, ResourceExhausted for more than any host lets wait,
  // Unavailable if the other side has gone.
  absl::Status Receive();

 private:
  struct Submitted {
    bool in = false;
    uint32_t length = 0;
    std::vector<std::byte> out;
  };

  // True if there was one.
  absl::StatusOr<bool> ReceiveOne();
  void Submit(uint32_t number, bool in);
  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in);
  void Forget(std::map<uint64_t, Submitted>::iterator which);

  ByteStream stream_;
  UsbDeviceModel& model_;
  std::vector<std::byte> head_;     // of the command that is coming
  std::vector<std::byte> payload_;  // and what follows it
  size_t have_ = 0;                 // of both
  std::map<uint64_t, Submitted> submitted_;
  size_t pending_bytes_ = 0;  // of submitted_
};

// Answers the handshake of one connection (OP_REQ_DEVLIST, OP_REQ_IMPORT for bus id "1-1"), which may
// wait for the other side for at most `limit_ms`. True: the URBs follow; false: it asked only for the
// list. InvalidArgument for what is not the protocol, NotFound for another device or one that is not
// plugged in, Unavailable if the other side has gone or keeps silent.
absl::StatusOr<bool> AnswerUsbipHandshake(int fd, UsbDeviceModel& model, int limit_ms);

// Attaches to this kernel's vhci_hcd through sysfs; needs root. The descriptor is the device's end.
absl::StatusOr<int> AttachToKernel(UsbSpeed speed);

}  // namespace voxeld::display::emulator
