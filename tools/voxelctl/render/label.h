// Words in pictures.
#pragma once

#include <string_view>

#include "daemon/text/stroke_font.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Capitals `height` pixels high, from (x, y), the baseline's left end, in light grey over what is there.
void DrawLabel(const text::StrokeFont& font, std::string_view ascii, double x, double y,
               double height, Image& image);

}  // namespace voxeld::voxelctl
