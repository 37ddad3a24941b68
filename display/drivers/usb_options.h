// How options say which USB device a display is.
#pragma once

#include "display/drivers/options.h"
#include "display/usb/usb_bus.h"

namespace voxeld::display {

// vendor=XXXX product=XXXX (hexadecimal), serial=TEXT, path=BUS-PORT[.PORT…]; each may be left out.
// Mistakes are the reader's to tell.
UsbMatch ReadUsbMatch(OptionReader& reader);

}  // namespace voxeld::display
