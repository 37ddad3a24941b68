// The Fadecandy's conformance suite: the requirements of docs/protocols/fadecandy.md on a board
// that a host can observe over USB. The light of a board cannot be observed.
#pragma once

#include "display/conformance/suite.h"

namespace voxeld::display::fadecandy {

conformance::Suite MakeSuite();

}  // namespace voxeld::display::fadecandy
