// The interface to a USB device, modelled on libusb: submit, cancel, completion with status and
// actual length, hotplug, a limit of the bytes in flight. Implementations: in-process (an emulated
// device in this process), libusb, and wrappers of either that record, replay and inject faults.
// Drivers use nothing else of USB.
//
// Threads: bound to the owner's thread, except for the wake function, which an implementation may
// call from any thread. Completions are queued and returned by Drain, so no code of ours runs
// inside a library's callback. No call blocks except Close, which returns within its limit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/usb/transfer_bytes.h"

namespace voxeld::display {

enum class TransferType : uint8_t { kControl, kBulk, kInterrupt };

// The eight bytes of a setup packet (USB 2.0, section 9.3).
struct UsbSetup {
  uint8_t request_type = 0;
  uint8_t request = 0;
  uint16_t value = 0;
  uint16_t index = 0;
  uint16_t length = 0;
};

enum class TransferStatus : uint8_t {
  kOk,
  kShort,     // IN: fewer bytes than requested (not an error by itself)
  kStall,     // endpoint halted (control: request refused)
  kTimedOut,  // OUT: actual_length must not be trusted
  kCancelled,
  kOverflow,  // the device sent more than requested
  kError,     // protocol error on the bus
  kDisconnected,
};

const char* TransferStatusName(TransferStatus status);

// Ascending; a transport never reuses one, however often it is opened.
using TransferId = uint64_t;

struct Transfer {
  TransferType type = TransferType::kBulk;
  uint8_t endpoint = 0;      // with bit 7 for IN
  UsbSetup setup;            // kControl only
  TransferBytes data;        // OUT: what to send; moved in, returned in the completion
  uint32_t length = 0;       // IN: bytes requested
  sync::TimeNs timeout = 0;  // 0: none
  // Bulk OUT of whole packets: an empty packet follows, for protocols that end messages with a
  // short packet.
  bool zero_packet = false;
};

struct TransferCompletion {
  TransferId id = 0;
  TransferType type = TransferType::kBulk;
  uint8_t endpoint = 0;
  TransferStatus status = TransferStatus::kOk;
  uint32_t actual_length = 0;
  // IN: the received data (actual_length bytes). OUT: the buffer.
  TransferBytes data;
};

struct UsbIdentity {
  uint16_t vendor_id = 0, product_id = 0, bcd_device = 0;
  std::string serial;  // as the device reports it: untrusted until escaped
  std::string path;    // bus position, "in-process" for emulated ones
};

class UsbTransport {
 public:
  virtual ~UsbTransport() = default;

  // Looks for the device, opens it and claims the interface. Errors: NotFound if no device matches.
  virtual absl::Status Open() = 0;
  // Sends the control transfers that the device answers at once, cancels everything else, and
  // closes; completions not yet drained are discarded. Idempotent.
  virtual void Close() = 0;
  virtual bool is_open() const = 0;
  virtual UsbIdentity identity() const = 0;

  // Queues a transfer; after an error `transfer` is unchanged. Errors: ResourceExhausted when
  // max_bytes_in_flight(), or the limit of all devices together, would be exceeded: submit again
  // after a wake. Unavailable when the device is gone.
  virtual absl::StatusOr<TransferId> Submit(Transfer&& transfer) = 0;
  // Makes the transfer complete as kCancelled, or as it would have; unknown ids are ignored.
  virtual void Cancel(TransferId id) = 0;
  // Clears the halt of an endpoint; completes as a control transfer with the returned id.
  virtual absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint) = 0;
  // Resets the device's port, after cancelling what is in flight. Completes as a control transfer
  // with the returned id: as kDisconnected if the device came back as another.
  virtual absl::StatusOr<TransferId> Reset() = 0;

  // Returns an empty buffer for OUT transfers with memory for `capacity` bytes: memory that the
  // kernel reads in place, if it offers that.
  virtual TransferBytes TakeBuffer(size_t capacity) = 0;

  // Moves all completions into `out`, in the order in which they happened. Returns how many.
  virtual size_t Drain(std::vector<TransferCompletion>& out) = 0;

  virtual size_t bytes_in_flight() const = 0;
  virtual size_t max_bytes_in_flight() const = 0;

  // Sets the function that is called, from any thread, when Drain has completions, or when a device
  // came or went. It must not call the transport. Once SetWake returns, the former function is no
  // longer called.
  virtual void SetWake(std::function<void()> wake) = 0;
  // Returns true once after a device arrived that Open may find, while none is open.
  virtual bool TakeArrival() = 0;
};

}  // namespace voxeld::display
