#include "display/usb/usbmon.h"

#include <cstring>

#include "absl/strings/str_cat.h"

namespace voxeld::display {
namespace {

// Linux's numbers, on every system.
enum Errno : int32_t {
  kEnoent = 2,
  kEio = 5,
  kEbadf = 9,
  kEnomem = 12,
  kEnodev = 19,
  kEinval = 22,
  kEpipe = 32,
  kEproto = 71,
  kEoverflow = 75,
  kEconnreset = 104,
  kEshutdown = 108,
  kEtimedout = 110,
  kEremoteio = 121,
};

}  // namespace

int32_t UsbmonStatus(TransferStatus status) {
  switch (status) {
    case TransferStatus::kOk:
    case TransferStatus::kShort:
      return 0;
    case TransferStatus::kStall:
      return -kEpipe;
    case TransferStatus::kTimedOut:
      return -kEtimedout;
    case TransferStatus::kCancelled:
      return -kEnoent;
    case TransferStatus::kOverflow:
      return -kEoverflow;
    case TransferStatus::kError:
      return -kEproto;
    case TransferStatus::kDisconnected:
      return -kEshutdown;
  }
  return -kEio;
}

TransferStatus StatusOfUsbmon(int32_t status, bool fewer) {
  switch (status) {
    case 0:
      return fewer ? TransferStatus::kShort : TransferStatus::kOk;
    case -kEremoteio:
      return TransferStatus::kShort;
    case -kEpipe:
      return TransferStatus::kStall;
    case -kEtimedout:
      return TransferStatus::kTimedOut;
    case -kEnoent:
    case -kEconnreset:
      return TransferStatus::kCancelled;
    case -kEoverflow:
      return TransferStatus::kOverflow;
    case -kEshutdown:
    case -kEnodev:
      return TransferStatus::kDisconnected;
    default:
      return TransferStatus::kError;
  }
}

int32_t UsbmonRefusal(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kResourceExhausted:
      return -kEnomem;
    case absl::StatusCode::kUnavailable:
      return -kEnodev;
    case absl::StatusCode::kFailedPrecondition:
      return -kEbadf;
    case absl::StatusCode::kInvalidArgument:
      return -kEinval;
    default:
      return -kEio;
  }
}

absl::Status StatusOfRefusal(int32_t status) {
  const std::string message = absl::StrCat("refused, as it was recorded (status ", status, ")");
  switch (status) {
    case -kEnomem:
      return absl::ResourceExhaustedError(message);
    case -kEnodev:
    case -kEshutdown:
      return absl::UnavailableError(message);
    case -kEbadf:
      return absl::FailedPreconditionError(message);
    case -kEinval:
      return absl::InvalidArgumentError(message);
    default:
      return absl::InternalError(message);
  }
}

uint8_t UsbmonXferType(TransferType type) {
  switch (type) {
    case TransferType::kControl:
      return UsbmonHeader::kControl;
    case TransferType::kInterrupt:
      return UsbmonHeader::kInterrupt;
    case TransferType::kBulk:
      break;
  }
  return UsbmonHeader::kBulk;
}

std::array<uint8_t, 8> SetupBytes(const UsbSetup& setup) {
  const auto low = [](uint16_t v) { return static_cast<uint8_t>(v & 0xFF); };
  const auto high = [](uint16_t v) { return static_cast<uint8_t>(v >> 8); };
  return {setup.request_type, setup.request,     low(setup.value),  high(setup.value),
          low(setup.index),   high(setup.index), low(setup.length), high(setup.length)};
}

UsbSetup SetupOfBytes(const std::array<uint8_t, 8>& bytes) {
  const auto word = [&](size_t i) {
    return static_cast<uint16_t>(bytes[i] | static_cast<uint16_t>(bytes[i + 1] << 8));
  };
  return {.request_type = bytes[0],
          .request = bytes[1],
          .value = word(2),
          .index = word(4),
          .length = word(6)};
}

UsbSetup ClearHaltSetup(uint8_t endpoint) {
  return {.request_type = 0x02, .request = 1, .value = 0, .index = endpoint, .length = 0};
}

}  // namespace voxeld::display
