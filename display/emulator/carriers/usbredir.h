// The device's side of usbredir 0.7 (https://gitlab.freedesktop.org/spice/usbredir, its protocol
// document): a device model as what QEMU plugs into a virtual machine's xhci.
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

// One connection. Single-threaded, as the model is: while it lives the model completes to it.
class UsbredirSession {
 public:
  // Takes the socket, and says that the device is there if it is.
  UsbredirSession(int fd, UsbDeviceModel& model);
  ~UsbredirSession();
  UsbredirSession(const UsbredirSession&) = delete;
  UsbredirSession& operator=(const UsbredirSession&) = delete;

  ByteStream& stream() { return stream_; }
  // Reads packets and carries them out. Anything but OK ends the session: InvalidArgument for what is not the
  // protocol, ResourceExhausted for more than any host lets wait, Unavailable if the other side has gone.
  absl::Status Receive();
  // Asks the model for what the other side listens to. Due after each call of the model.
  void ReadOn();
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
    uint64_t id = 0;      // the other side's
    uint32_t length = 0;  // bytes that it carries or asks for
  };

  void Connect();
  void Submit(Submitted submitted, uint32_t length);
  // The host controller's own requests (configuration, interface), carried to the model.
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
  size_t pending_bytes_ = 0;      // of submitted_
  size_t budget_ = 0;             // bytes to read until others have their turn
  bool greeted_ = false;          // the other side has said which protocol it speaks
  bool connected_ = false;        // it has been told of the device
  bool overrun_ = false;          // it let more wait than is allowed
  std::set<uint8_t> reading_;     // interrupt endpoints that the other side listens to
  std::set<uint8_t> halted_;      // of them, those that stalled and were not cleared since
  std::vector<uint8_t> to_read_;  // of them, those that no read waits on
  std::map<uint8_t, uint16_t> packets_;
};

}  // namespace voxeld::display::emulator
