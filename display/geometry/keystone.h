// Computes a homography from the places of an image's corners.
#pragma once

#include <array>
#include <optional>

#include "display/geometry/homography.h"

namespace voxeld::display {

// Returns the homography that maps the corners (−u, −v), (u, −v), (u, v), (−u, v) of `half` to
// `to`. Returns nothing if three of these lie on a line.
std::optional<Homography> HomographyOfCorners(PicturePlace half,
                                              const std::array<PicturePlace, 4>& to);

}  // namespace voxeld::display
