// What a display is, from its options.
#pragma once

#include "display/api/geometry.h"
#include "display/drivers/options.h"

namespace voxeld::display {

// The keys of a geometry as ReadDisplayInfo has them; `pitch` of pixels, mm. What is wrong by itself is `reader`'s error, what does
// not fit together ValidateShape's; then something valid or not comes back.
Geometry ReadGeometry(OptionReader& reader, double pitch);

}  // namespace voxeld::display
