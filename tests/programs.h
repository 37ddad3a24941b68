// Paths of the programs that tests start.
#pragma once

#include "tools/child/programs.h"

namespace voxeld {

using child::ProgramBeside;

}  // namespace voxeld
