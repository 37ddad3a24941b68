// Random grids of samples: of any format, with NaNs and infinities, as volumes and at levels.
#pragma once

#include "tests/conformance/scene_generator.h"
#include "tests/conformance/scene_model.h"

namespace voxeld::gpu::conformance {

// Fills the indices of a kSamples; the rest of the record is already set.
void AddSamples(SceneGenerator& random, ModelGeometry& g);

}  // namespace voxeld::gpu::conformance
