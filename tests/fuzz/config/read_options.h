// A display's options, read as drivers do.
#pragma once

#include "display/drivers/options.h"

namespace voxeld::fuzz {

// Geometry and tone; of those that are taken, that they hold together.
void ReadOptions(const display::DisplayOptions& options);

}  // namespace voxeld::fuzz
