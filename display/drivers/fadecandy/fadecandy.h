// Creates displays made of Fadecandy boards from options, which README.md lists.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/conformance/suite.h"
#include "display/drivers/driver_context.h"
#include "display/drivers/options.h"
#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::fadecandy {

// README.md lists the options.
absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context);

// Returns each board that the display would drive as a subject.
absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context);

struct BoardPlace {
  std::string
      serial;  // if empty: the board with index `index` by serial number among `count` boards
  size_t index = 0, count = 1;
  std::string record;  // file for recording its traffic, or empty
};
// Makes a transport to that board, which need not be present. Never null.
using MakeTransport =
    std::function<absl::StatusOr<std::unique_ptr<UsbTransport>>(const BoardPlace& board)>;

// Creates a stopped display. Errors: InvalidArgument for an unknown option or a bad value, with
// what is expected; or the error of `make_transport`, which is called before the function returns.
// `clock` must outlive the display.
absl::StatusOr<std::unique_ptr<Display>> CreateOver(const DisplayOptions& options,
                                                    sync::Clock& clock,
                                                    const MakeTransport& make_transport);

}  // namespace voxeld::display::fadecandy
