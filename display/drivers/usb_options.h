// How options say which USB device a display is, and what is kept of what goes over its cable.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "display/drivers/driver_context.h"
#include "display/drivers/options.h"
#include "display/usb/usb_bus.h"

namespace voxeld::display {

struct UsbOptions {
  UsbMatch match;
  std::string record;  // a path, or nothing
};

// vendor=XXXX product=XXXX (hexadecimal), serial=TEXT, path=BUS-PORT[.PORT…]; each may be left out.
// Mistakes are the reader's to tell.
UsbMatch ReadUsbMatch(OptionReader& reader);

// record=FILE: everything that goes over the cable, as pcapng (docs/recordings.md). Empty: nothing.
std::string ReadUsbRecord(OptionReader& reader);

// A closed transport to what `options` mean, on the context's bus. What the bus says; of a recording
// whose file cannot be written, an error with its path. `display` names the recording's interface.
absl::StatusOr<std::unique_ptr<UsbTransport>> MakeUsbTransport(const UsbOptions& options,
                                                               const std::string& display,
                                                               const DriverContext& context);

}  // namespace voxeld::display
