// Creates displays behind a network controller from options, which README.md lists.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/conformance/suite.h"
#include "display/drivers/driver_context.h"
#include "display/drivers/network/link.h"
#include "display/drivers/network/packets.h"
#include "display/drivers/options.h"

namespace voxeld::display::network {

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context);

// Always Unimplemented: controllers send no answers that could be checked.
absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context);

// Makes the link that carries packets of that protocol to the endpoint.
using MakeLink = std::function<std::unique_ptr<Link>(Protocol protocol, const Endpoint& to)>;

// Creates a stopped display. Errors: InvalidArgument for an unknown option or a bad value, with
// what is expected.
absl::StatusOr<std::unique_ptr<Display>> CreateOver(const DisplayOptions& options,
                                                    sync::Clock& clock, const MakeLink& make_link);

}  // namespace voxeld::display::network
