#include "display/usb/usb_transport.h"

namespace voxeld::display {

const char* TransferStatusName(TransferStatus status) {
  switch (status) {
    case TransferStatus::kOk:
      return "ok";
    case TransferStatus::kShort:
      return "short";
    case TransferStatus::kStall:
      return "stall";
    case TransferStatus::kTimedOut:
      return "timed out";
    case TransferStatus::kCancelled:
      return "cancelled";
    case TransferStatus::kOverflow:
      return "overflow";
    case TransferStatus::kError:
      return "protocol error";
    case TransferStatus::kDisconnected:
      return "disconnected";
  }
  return "?";
}

}  // namespace voxeld::display
