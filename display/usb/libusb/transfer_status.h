// Translates libusb's statuses to TransferStatus.
#pragma once

#include "display/usb/usb_transport.h"

struct libusb_transfer;

namespace voxeld::display {

// For a transfer that ended.
TransferStatus StatusOf(const libusb_transfer& done);
// For a blocking call's result: 0, or a LIBUSB_ERROR.
TransferStatus StatusOf(int result);

}  // namespace voxeld::display
