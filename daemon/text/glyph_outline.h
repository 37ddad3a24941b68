// Converts FreeType outlines to contours of cubic Béziers. Stateless and reentrant.
#pragma once

#include <ft2build.h>
#include FT_FREETYPE_H

#include <vector>

#include "daemon/text/fonts.h"

namespace voxeld::text {

// Returns: the contours with all lengths multiplied by `scale`; empty if the outline is broken.
std::vector<Contour> ContoursOf(FT_Outline& outline, double scale);

}  // namespace voxeld::text
