// Text in pictures.
#pragma once

#include <string_view>

#include "daemon/text/stroke_font.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Draws capitals `height` pixels high, from (x, y), the left end of the baseline, in light grey
// over the existing picture.
void DrawLabel(const text::StrokeFont& font, std::string_view ascii, double x, double y,
               double height, Image& image);

}  // namespace voxeld::voxelctl
