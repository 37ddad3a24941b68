// Displays made of Fadecandy boards, from options. README.md lists them.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/drivers/options.h"
#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::fadecandy {

// A transport to the board with that serial number, or, if `serial` is empty, to the one that is
// number `index` of all in ascending order of serial number. Never null; the board need not be
// there.
using MakeTransport =
    std::function<std::unique_ptr<UsbTransport>(const std::string& serial, size_t index)>;

// A stopped display. InvalidArgument for an unknown option or a bad value, with what would be
// right. `clock` outlives it; `make_transport` is called before the function returns.
absl::StatusOr<std::unique_ptr<Display>> CreateOver(const DisplayOptions& options,
                                                    sync::Clock& clock,
                                                    const MakeTransport& make_transport);

}  // namespace voxeld::display::fadecandy
