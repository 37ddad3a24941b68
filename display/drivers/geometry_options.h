// Reads a display's geometry from its options.
#pragma once

#include "display/api/geometry.h"
#include "display/drivers/options.h"

namespace voxeld::display {

// Reads the keys of a geometry as listed at ReadDisplayInfo; `pitch` is that of pixels, mm. A value
// that is wrong by itself is `reader`'s error; inconsistent values are left for ValidateShape, and
// the result may then be invalid.
Geometry ReadGeometry(OptionReader& reader, double pitch);

}  // namespace voxeld::display
