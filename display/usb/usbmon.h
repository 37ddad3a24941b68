// The header of each packet in a USB recording: the 64 bytes of Linux's usbmon
// (Documentation/usb/usbmon.rst, struct usbmon_packet), as in captures of link type
// LINKTYPE_USB_LINUX_MMAPPED, and the translation between its values and ours.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "absl/status/status.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

static_assert(std::endian::native == std::endian::little, "recordings are written as they lie");

// In the byte order of the capturing machine. A transfer is one kSubmit and one kComplete with the
// same id; a transfer that the host refused to start is a kSubmit and a kError.
struct UsbmonHeader {
  enum Type : uint8_t { kSubmit = 'S', kComplete = 'C', kError = 'E' };
  enum XferType : uint8_t { kIsochronous = 0, kInterrupt = 1, kControl = 2, kBulk = 3 };

  uint64_t id;
  uint8_t type;
  uint8_t xfer_type;
  uint8_t epnum;  // with bit 7 for IN; for a control transfer the direction of its data
  uint8_t devnum;
  uint16_t busnum;
  uint8_t flag_setup;  // 0: `setup` is valid; else '-'
  uint8_t flag_data;   // 0: data follow; else '<' (IN, submitted) or '>' (OUT, complete)
  int64_t ts_sec;      // since 1970
  int32_t ts_usec;
  int32_t status;    // kSubmit: -EINPROGRESS; else 0 or an errno, negative
  uint32_t length;   // requested, or transferred
  uint32_t len_cap;  // bytes that follow
  std::array<uint8_t, 8> setup;
  int32_t interval;
  int32_t start_frame;
  uint32_t xfer_flags;  // of the kernel's struct urb
  uint32_t ndesc;
};
static_assert(sizeof(UsbmonHeader) == 64);
static_assert(offsetof(UsbmonHeader, ts_sec) == 16 && offsetof(UsbmonHeader, setup) == 40);

inline constexpr uint8_t kUsbmonAbsent = '-';
inline constexpr uint8_t kUsbmonDataIn = '<';
inline constexpr uint8_t kUsbmonDataOut = '>';
inline constexpr uint32_t kUrbZeroPacket = 0x0040;
inline constexpr uint32_t kUrbDirIn = 0x0200;
inline constexpr int32_t kUsbmonInProgress = -115;  // -EINPROGRESS, on Linux

// Returns a completion's status as the kernel's value: kOk and kShort are 0.
int32_t UsbmonStatus(TransferStatus status);
// The inverse; `fewer`: an IN transfer returned less than requested. Unknown values become kError.
TransferStatus StatusOfUsbmon(int32_t status, bool fewer);

// Converts a refused Submit, and back.
int32_t UsbmonRefusal(const absl::Status& status);
absl::Status StatusOfRefusal(int32_t status);

uint8_t UsbmonXferType(TransferType type);

std::array<uint8_t, 8> SetupBytes(const UsbSetup& setup);
UsbSetup SetupOfBytes(const std::array<uint8_t, 8>& bytes);

// USB 2.0 §9.4.1, CLEAR_FEATURE(ENDPOINT_HALT): how a ClearHalt is recorded.
UsbSetup ClearHaltSetup(uint8_t endpoint);
// USB 2.0 §11.24.2.13, SET_FEATURE(PORT_RESET), as sent to the hub: how a Reset is recorded.
inline constexpr UsbSetup kPortResetSetup{.request_type = 0x23, .request = 3, .value = 4};

}  // namespace voxeld::display
