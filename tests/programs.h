// Where tests find the programs that they start.
#pragma once

#include "tools/child/programs.h"

namespace voxeld {

using child::ProgramBeside;

}  // namespace voxeld
