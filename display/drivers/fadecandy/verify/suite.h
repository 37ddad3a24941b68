// The Fadecandy's conformance suite: what docs/protocols/fadecandy.md says of a board and a host can
// see over USB. What a board lights cannot be seen.
#pragma once

#include "display/conformance/suite.h"

namespace voxeld::display::fadecandy {

conformance::Suite MakeSuite();

}  // namespace voxeld::display::fadecandy
