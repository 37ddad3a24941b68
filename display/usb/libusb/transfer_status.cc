#include "display/usb/libusb/transfer_status.h"

#include <libusb-1.0/libusb.h>

namespace voxeld::display {

TransferStatus StatusOf(const libusb_transfer& done) {
  const bool in =
      (done.endpoint & LIBUSB_ENDPOINT_IN) != 0 ||
      (done.type == LIBUSB_TRANSFER_TYPE_CONTROL && (done.buffer[0] & LIBUSB_ENDPOINT_IN) != 0);
  const int whole = done.type == LIBUSB_TRANSFER_TYPE_CONTROL
                        ? done.length - static_cast<int>(LIBUSB_CONTROL_SETUP_SIZE)
                        : done.length;
  switch (done.status) {
    case LIBUSB_TRANSFER_COMPLETED:
      if (done.actual_length >= whole) return TransferStatus::kOk;
      return in ? TransferStatus::kShort : TransferStatus::kError;
    case LIBUSB_TRANSFER_TIMED_OUT:
      return TransferStatus::kTimedOut;
    case LIBUSB_TRANSFER_CANCELLED:
      return TransferStatus::kCancelled;
    case LIBUSB_TRANSFER_STALL:
      return TransferStatus::kStall;
    case LIBUSB_TRANSFER_NO_DEVICE:
      return TransferStatus::kDisconnected;
    case LIBUSB_TRANSFER_OVERFLOW:
      return TransferStatus::kOverflow;
    case LIBUSB_TRANSFER_ERROR:
      break;
  }
  return TransferStatus::kError;
}

TransferStatus StatusOf(int result) {
  switch (result) {
    case 0:
      return TransferStatus::kOk;
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:  // after a reset: it came back as another device
      return TransferStatus::kDisconnected;
    case LIBUSB_ERROR_TIMEOUT:
      return TransferStatus::kTimedOut;
    case LIBUSB_ERROR_PIPE:
      return TransferStatus::kStall;
    default:
      return TransferStatus::kError;
  }
}

}  // namespace voxeld::display
