// Outlines as FreeType has them into contours of cubic Béziers. Words only; reentrant.
#pragma once

#include <ft2build.h>
#include FT_FREETYPE_H

#include <vector>

#include "daemon/text/fonts.h"

namespace voxeld::text {

// All lengths times `scale`. Empty if the outline is broken.
std::vector<Contour> ContoursOf(FT_Outline& outline, double scale);

}  // namespace voxeld::text
