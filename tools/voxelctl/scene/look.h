// The style of models: which of their elements are drawn, and in which colours.
#pragma once

#include <cstddef>
#include <span>

#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

enum class FillStyle : uint8_t { kSurface, kLines, kDots };

struct LookOptions {
  FillStyle fill = FillStyle::kSurface;
  bool flat = false;  // unshaded colours
};

// Makes every part what `fill` requests (kLines: each edge of a triangle once; kDots: the vertices;
// parts without a surface stay unchanged). Gives every part colours: its own, or a default by kind
// and position in `models`. They are shaded by the normals as placed, so call it after PlaceModels.
// Very dark colours are brightened, because a display can only add light. Normals are dropped
// afterwards.
void ApplyLook(std::span<Model> models, const LookOptions& options);

}  // namespace voxeld::voxelctl
