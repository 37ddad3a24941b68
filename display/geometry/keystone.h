// A homography from where a picture's corners are.
#pragma once

#include <array>
#include <optional>

#include "display/geometry/homography.h"

namespace voxeld::display {

// The one that takes the corners (−u, −v), (u, −v), (u, v), (−u, v) of `half` to `to`. Nothing if three of these lie in a line.
std::optional<Homography> HomographyOfCorners(PicturePlace half,
                                              const std::array<PicturePlace, 4>& to);

}  // namespace voxeld::display
