// What libusb's words mean in ours.
#pragma once

#include "display/usb/usb_transport.h"

struct libusb_transfer;

namespace voxeld::display {

// Of a transfer that ended.
TransferStatus StatusOf(const libusb_transfer& done);
// Of a call that waited: 0, or a LIBUSB_ERROR.
TransferStatus StatusOf(int result);

}  // namespace voxeld::display
