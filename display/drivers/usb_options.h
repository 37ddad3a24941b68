// The options that select a display's USB device and the recording of its traffic.
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
  std::string record;  // a path, or empty
};

// Reads vendor=XXXX product=XXXX (hexadecimal), serial=TEXT, path=BUS-PORT[.PORT…]; each may be
// left out. Errors are recorded in the reader.
UsbMatch ReadUsbMatch(OptionReader& reader);

// Reads record=FILE: records all USB traffic as pcapng (docs/recordings.md). Empty: no recording.
std::string ReadUsbRecord(OptionReader& reader);

// Returns a closed transport to the device that `options` select, on the context's bus. Errors: the
// bus's; for a recording whose file cannot be written, an error with its path. `display` names the
// recording's interface.
absl::StatusOr<std::unique_ptr<UsbTransport>> MakeUsbTransport(const UsbOptions& options,
                                                               const std::string& display,
                                                               const DriverContext& context);

}  // namespace voxeld::display
