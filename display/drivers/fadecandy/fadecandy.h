// Displays made of Fadecandy boards, from options. README.md lists them.
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

// Each board that the display would drive is a subject.
absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context);

struct BoardPlace {
  std::string
      serial;  // if empty: of `count` boards the one that is number `index` by serial number
  size_t index = 0, count = 1;
  std::string record;  // where its traffic goes, or nothing
};
// A transport to that board, which need not be there. Not null.
using MakeTransport =
    std::function<absl::StatusOr<std::unique_ptr<UsbTransport>>(const BoardPlace& board)>;

// A stopped display. InvalidArgument for an unknown option or a bad value, with what would be
// right; what `make_transport` says, which is called before the function returns. `clock` outlives
// the display.
absl::StatusOr<std::unique_ptr<Display>> CreateOver(const DisplayOptions& options,
                                                    sync::Clock& clock,
                                                    const MakeTransport& make_transport);

}  // namespace voxeld::display::fadecandy
