// Reads a display's options as drivers do.
#pragma once

#include "display/drivers/options.h"

namespace voxeld::fuzz {

// Reads geometry and tone; if they are accepted, checks that they are consistent.
void ReadOptions(const display::DisplayOptions& options);

}  // namespace voxeld::fuzz
