// How models look: which of their elements are drawn, in which colours.
#pragma once

#include <cstddef>
#include <span>

#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

enum class FillStyle : uint8_t { kSurface, kLines, kDots };

struct LookOptions {
  FillStyle fill = FillStyle::kSurface;
  bool flat = false;  // colours as they are, without shading
};

// Makes every part what `fill` asks for (kLines: each edge of a triangle once; kDots: the vertices;
// what has no surface stays as it is) and gives every part colours: its own, or a default by kind
// and place in `models`, shaded by the normals as placed, so call it after PlaceModels. Very dark
// colours are lifted: light is all that a display can add. Normals are dropped afterwards.
void ApplyLook(std::span<Model> models, const LookOptions& options);

}  // namespace voxeld::voxelctl
